"""Flights of the emulated rig with hidden effects, and the judgement of their diagnoses.

- `sizes` and `cases` define what is hidden;
- `equivalences` lists what no recording can separate (fixed before any case is judged);
- `judge` defines a correct answer;
- `run` diagnoses case after case;
- `tally` counts.

The diagnosis gets a recording and a profile. Only its JSON document is judged.
"""
