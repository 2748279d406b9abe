"""Diagnose a simulation: its errors, their causes, and the errors of a model with these causes."""
