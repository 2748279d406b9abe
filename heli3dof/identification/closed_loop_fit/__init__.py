"""Fits to closed-loop recordings with a known controller, also on encoder limit cycles.

- `setup`: the settings of such a fit
- `base_fit`: fits the base simulation, the model to which a diagnosis adds effects
- `limit_cycle`: detects limit cycles, estimates the process noise on them
- `edge_rates`: fits on limit cycles that also match how often the encoder counts change
- `identify_correction`: decides for ``identify`` whether and how a fit is corrected
"""
