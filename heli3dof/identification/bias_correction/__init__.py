"""Bias-corrected fits to recordings with a known controller, by simulated flights.

- `correction`: the correction, also of the diagnosis, and the covariance of the corrected fit
- `corrected_maximum`: the maximum of the corrected likelihood, for further terms
- `simulated_flight`: one closed-loop flight of a fitted model with noise
- `evaluation`: the likelihood's score and information, from the traces of `perturbation` (its
  compiled loops: `perturbation_passes`)
- `coloured_noise`: how much coloured noise increases the variances
"""
