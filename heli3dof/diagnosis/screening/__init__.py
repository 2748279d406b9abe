"""The score test of every candidate effect against simulated nulls."""
