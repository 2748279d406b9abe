"""Diagnose logs by free-run predictions, if the likelihood of a fit to them is not valid.

Unmodelled fast motion and sampling jitter make it invalid (`identification.greybox.noise_check`).
"""
