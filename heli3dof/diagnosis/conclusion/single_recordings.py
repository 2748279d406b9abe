"""Find causes that single recordings do not confirm, or that differ in size between them.

A joint fit also attributes differences between recordings (warm motors, battery, thrust at another
voltage) to the terms. The likelihood's σ does not contain these differences. So each recording is
fitted alone with the same terms. A term's first parameter has the estimate θ_i ± σ_i in recording i
and the null value θ_0 (no effect). The recordings confirm the cause if both hold:

    significant:   max_i |θ_i − θ_0|/σ_i ≥ `SIGNIFICANT`
    of one size:   |θ_i − θ_j| ≤ `SIGMAS_99` √(σ_i² + σ_j²)     for all i, j

Recordings that cannot be fitted are ignored. If fewer than two are left, every cause is confirmed.
A periodic torque and an added mass are neither fitted nor tested here: only a scan finds their
frequency or instant.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from heli3dof.diagnosis.constants import SIGMAS_99
from heli3dof.errors import RecordingError
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.method import fit_greybox
from heli3dof.model.effects import term
from heli3dof.model.physics.parametrisation import first_parameters
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

SIGNIFICANT = 1.645
"""Least distance from θ_0 in standard deviations: the one-sided 95 % quantile of the normal
distribution"""


def not_confirmed(names: Sequence[str], recordings: Sequence[Recording]) -> set[str]:
    """Return the terms that the recordings, each fitted alone, do not confirm."""
    tested = [n for n in names if not term(n).effect.scan]
    if len(recordings) < 2 or not tested:
        return set()
    results = parallel_map(lambda i: _fit_alone(recordings[i], tested), len(recordings))
    fits = [f for f in results if f is not None]
    if len(fits) < 2:
        return set()
    return {n for n in tested if not confirmed([size(f, n) for f in fits])}


def confirmed(sizes: Sequence[tuple[float, float]]) -> bool:
    """Return whether sizes (θ − θ_0, σ), one per recording, agree and at least one is significant.

    >>> confirmed([(0.9, 0.8), (1.9, 1.4), (10.0, 6.5)])  # none is significant
    False
    >>> confirmed([(2.2, 0.3), (1.0, 2.0)]), confirmed([(2.2, 0.3), (-2.0, 0.3)])
    (True, False)
    """
    significant = any(abs(d) >= SIGNIFICANT * s for d, s in sizes if s > 0)
    return significant and all(of_one_size(*pair) for pair in itertools.combinations(sizes, 2))


def of_one_size(a: tuple[float, float], b: tuple[float, float]) -> bool:
    """Return whether estimates (value, σ) differ by at most `SIGMAS_99` σ of the difference."""
    return abs(a[0] - b[0]) <= SIGMAS_99 * math.hypot(a[1], b[1])


def size(fit: Estimate, name: str) -> tuple[float, float]:
    """Return a term's size: its first parameter θ minus θ_0 (no effect), and the estimate's σ.

    A parameter on a logarithmic scale has no value without effect; then θ_0 is 0.
    """
    j = first_parameters(fit.free)[name]
    f = fit.free[j]
    return float(fit.values[j]) - (0.0 if f.log else f.null), float(fit.std[j])


def _fit_alone(recording: Recording, names: Sequence[str]) -> Estimate | None:
    try:
        return fit_greybox(recording, names)
    except RecordingError:
        return None
