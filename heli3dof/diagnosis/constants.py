"""Limits that several modules of the diagnosis share."""

FALSE_ALARMS = 0.003
"""Probability of a false finding in a recording of a rig without any effect. Chosen."""
LEVEL = 0.95
"""Probability covered by intervals: the usual 95 %."""
QUANTILE_975 = 1.96
"""97.5 % quantile of the normal distribution: two-sided significance at 5 %."""
SIGMAS_95 = 2.0
"""Standard deviations of a significant difference: chance exceeds them in 5 % of cases."""
SIGMAS_997 = 3.0
"""Standard deviations of a contradiction: chance exceeds them in 0.3 % of cases."""
TIE = 6.0
"""Difference of scores (2 ln L) that chance may cause: odds of e³ = 20. Chosen; not derived."""
SUFFICIENT = 100.0
"""Score that is enough for any further cause. Chosen; not derived."""
DRIFT = 0.25
"""Uncertainty of a score's mean in null simulations, relative to this mean. Chosen; not derived."""
LARGE = 5.0
"""Largest plausible size of a parameter, in units of its typical size. Chosen; not derived."""
MAX_CAUSES = 4
"""Largest number of causes in a diagnosis, and of confounded causes that are simulated to choose a
plan. Chosen."""
MAX_COMPARED = 3
"""Largest number of causes, torques or terms that one step compares or adds. Each of them requires
refits. Chosen."""
