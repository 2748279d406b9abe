"""Predictions of held-out data: errors, their decrease (gain), and confidence intervals."""
