"""Torques that no effect of the catalogue explains."""
