"""Score test of every candidate effect, calibrated by simulated nulls."""
