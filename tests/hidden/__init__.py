"""Flights of simulated rigs with hidden effects, and the judgement of their diagnoses.

- `sizes` and `cases` define what is hidden in the emulated rig, `rig_cases` in rigs with other
  parameters, `third_cases` in a plant with equations of its own (`third_plant`);
- `equivalences` lists what no recording can separate (fixed before any case is judged);
- `judge` defines a correct answer;
- `run` diagnoses case after case;
- `tally` counts.

The diagnosis gets a recording and a profile. Only its JSON document is judged.
"""
