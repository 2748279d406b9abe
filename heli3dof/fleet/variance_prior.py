"""Prior of a quantity's variance from flight to flight, estimated from a rig's siblings.

The siblings of a rig are the other rigs of the fleet. A few flights of one rig hardly determine the
variance φ² of its values. But rigs of one type have similar φ², so the siblings give a prior. For
sibling r, q_r estimates φ² from the differences between the values y of two consecutive flights
that have the same plan. A step of y changes only one difference (von Neumann, Ann. Math. Stat. 12,
1941)::

    q_r = mean of (yᵢ₊₁ − yᵢ)²/2 over n_r differences,   f_r = 2n_r²/(3n_r − 1) degrees of freedom

The assumed distribution of φ² over the rigs is d·φ₀²/χ²_d, where χ²_d is chi-squared with d degrees
of freedom. ψ is the digamma and ψ' the trigamma function. The mean E and the variance V of ln q_r
are::

    E = ln φ₀² + ψ(f_r/2) − ln(f_r/2) − ψ(d/2) + ln(d/2),   V = ψ'(f_r/2) + ψ'(d/2)

Smyth (Stat. Appl. Genet. Mol. Biol. 3, 2004) estimates E and V by the mean and variance over r, and
solves for φ₀² and d. Here the median replaces the mean, and 1.4826 times the median absolute
deviation replaces √V. So an outlying q_r, such as that of a drifting rig, has little influence. d
is limited to the range from 1 to Σf_r. The limit Σf_r is the number of degrees of freedom of all
q_r together.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heli3dof.fleet.change_posterior import VariancePrior
from heli3dof.fleet.tracks import Track

LEAST_SIBLINGS = 5
"""Fewest siblings from which the distribution of φ² over the rigs is estimated. Chosen."""
LEAST_DIFFERENCES = 4
"""Fewest differences n_r of a sibling that is used; fewer give f_r ≤ 9/4. Chosen."""
MAD_TO_STD = 1.4826
"""Ratio of the standard deviation of a normal distribution to its median absolute deviation"""


def variance_prior(siblings: Sequence[Track]) -> VariancePrior | None:
    """Return the prior of a quantity's variance between the flights of one rig, from other rigs.

    ``siblings``: one track (the quantity's values in the flights of a rig) for each of the other
    rigs. The prior is None if fewer than `LEAST_SIBLINGS` of these rigs have at least
    `LEAST_DIFFERENCES` differences between consecutive flights.
    """
    from scipy.special import digamma, polygamma

    found = [d for d in map(_squares, siblings) if len(d) >= LEAST_DIFFERENCES and d.any()]
    if len(found) < LEAST_SIBLINGS:
        return None
    n = np.array([len(d) for d in found], dtype=float)
    f = 2 * n**2 / (3 * n - 1)
    q = np.array([np.mean(d) / 2 for d in found])
    centred = np.log(q) - digamma(f / 2) + np.log(f / 2)
    deviation = MAD_TO_STD * float(np.median(np.abs(centred - np.median(centred))))
    between = deviation**2 - float(np.median(polygamma(1, f / 2)))
    most = float(f.sum())
    d = min(most, max(1.0, _inverse_trigamma(between))) if between > 0 else most
    shift = float(np.log(d / 2) - digamma(d / 2))
    return VariancePrior(float(np.exp(np.median(centred) - shift)), d)


def _squares(track: Track) -> np.ndarray:
    """Return the squared changes of the track's quantity from one flight to the next.

    `Track.hidden` is added. A change is left out if the two flights have different flight plans.
    """
    squares = np.diff(track.y) ** 2 + track.hidden[1:] + track.hidden[:-1]
    return np.asarray(squares[track.plans[1:] == track.plans[:-1]])


def _inverse_trigamma(value: float) -> float:
    """Return d with trigamma(d/2) = ``value`` > 0.

    >>> round(_inverse_trigamma(1.6449341), 4)
    2.0
    """
    from scipy.optimize import brentq
    from scipy.special import polygamma

    low, high = 1e-3, 1e9
    if value <= polygamma(1, high / 2):
        return high
    if value >= polygamma(1, low / 2):
        return low
    return float(brentq(lambda d: polygamma(1, d / 2) - value, low, high))
