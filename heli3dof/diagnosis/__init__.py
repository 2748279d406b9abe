"""Diagnose simulations: their errors, the causes, and the smaller errors of an extended model."""
