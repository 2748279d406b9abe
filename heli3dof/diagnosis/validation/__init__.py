"""Predictions of held-out data: errors, gains and their intervals."""
