"""Bias-corrected fits: the likelihood evaluated, its bias simulated and removed."""
