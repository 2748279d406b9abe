"""Diagnose simulations: their errors, the causes, and the gain of an extended model."""
