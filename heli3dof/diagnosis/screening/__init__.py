"""Score test of every candidate effect, calibrated by simulated flights without the effect."""
