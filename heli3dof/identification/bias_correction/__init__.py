"""Bias-corrected fits, for recordings whose controller is known: simulated moments."""
