"""Fits of the base simulation: limit cycles, base parameters, corrected maximum likelihood."""
