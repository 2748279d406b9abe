"""Fits of the base simulation: likelihood, bias correction, limit cycles, base parameters."""
