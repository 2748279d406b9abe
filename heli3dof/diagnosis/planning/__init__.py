"""Recommend the next experiment: the flight plan that best separates confounded causes.

To find it, each plan is simulated with each cause in the model.
"""
