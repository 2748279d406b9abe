"""Diagnose logs without a usable likelihood, by free-run predictions."""
