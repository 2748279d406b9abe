"""Fits to closed-loop recordings with a known controller, also on encoder limit cycles.

- `setup`: the settings of such a fit
- `base_fit`: fit of the base simulation
- `limit_cycle`: detects limit cycles, matches the process noise; `edge_rates`: fits on them
- `identify_correction`: decides for ``identify`` whether and how a fit is corrected
"""
