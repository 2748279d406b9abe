"""Recommend the next experiment: plans simulated to separate confounded causes."""
