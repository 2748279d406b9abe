"""Flights of the emulated rig that hide something, and what a diagnosis says of them.

`sizes` and `cases` say what is hidden, `equivalences` what no recording can tell (stated before
anything is judged), `judge` what counts as right, `run` diagnoses case after case, `tally` counts.
The diagnosis gets a recording and a profile; its JSON document alone is judged, as an outsider
would.
"""
