"""Diagnose logs by free-run (multi-step) predictions.

This method replaces maximum likelihood if unmodelled fast motion or sampling jitter make the
likelihood of a fit to the logs invalid (`identification.greybox.noise_check`).
"""
