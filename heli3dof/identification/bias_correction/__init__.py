"""Bias-corrected fits to recordings with a known controller, by simulated flights.

- `correction`: the correction, which the diagnosis also uses, and the corrected fit's covariance
- `corrected_maximum`: the maximum of the corrected likelihood of a model with further effects
- `simulated_flight`: one closed-loop flight of a fitted model with noise
- `evaluation`: the likelihood's score and information
- `perturbation`: how a small change of the model changes the filter's predictions; `evaluation`
  uses it (compiled loops: `perturbation_passes`)
- `scans`: the score of a torque at every frequency or instant
- `coloured_noise`: how much coloured noise increases the parameters' variances
"""
