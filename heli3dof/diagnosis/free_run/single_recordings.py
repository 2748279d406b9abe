"""Whether some recording shows a cause by itself, where several were fitted and no loop is known.

Together, recordings are compared with one another, and all that differs between them (motors that
got warm, a battery, the slope of thrust between two levels of voltage) goes into what the terms
make of the comparison. The likelihood's σ knows of none of that. So each recording is fitted alone
with the same terms, and of each term's first number, θ_i ± σ_i in recording i and θ_0 its absence,

    shown by itself:  max_i |θ_i − θ_0|/σ_i  ≥ `SEEN`
    of one size:      |θ_i − θ_j| ≤ `APART` √(σ_i² + σ_j²)       for all i, j

A name that is not both is borne by the comparison alone. Recordings in which nothing can be fitted
have no say; where only one is left, nothing is compared and nothing is doubted.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from heli3dof.diagnosis.free_run.halves import APART, SEEN
from heli3dof.errors import RecordingError
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.method import fit_greybox
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

ONE_TIME = ("mass.change",)
"""What happens at one instant of one recording cannot be looked for in the others."""


def only_compared(names: Sequence[str], recordings: Sequence[Recording]) -> set[str]:
    """Those of the terms that no recording shows by itself, or that have two sizes in two."""
    asked = [n for n in names if not n.startswith(ONE_TIME)]
    if len(recordings) < 2 or not asked:
        return set()
    fits = parallel_map(lambda i: _alone(recordings[i], asked), len(recordings))
    told = [f for f in fits if f is not None]
    if len(told) < 2:
        return set()
    return {n for n in asked if not significant([size(f, n) for f in told])}


def significant(sizes: Sequence[tuple[float, float]]) -> bool:
    """Whether one of the (θ − θ_0, σ) shows it, and none gives it another size.

    >>> borne([(0.9, 0.8), (1.9, 1.4), (10.0, 6.5)])  # together it may be 1.6 ± 0.1: of what?
    False
    >>> borne([(2.2, 0.3), (1.0, 2.0)]), borne([(2.2, 0.3), (-2.0, 0.3)])
    (True, False)
    """
    seen = any(abs(d) >= SEEN * s for d, s in sizes if s > 0)
    pairs = itertools.combinations(sizes, 2)
    one = all(abs(a - b) <= APART * math.hypot(s, t) for (a, s), (b, t) in pairs)
    return seen and one


def size(fit: Estimate, name: str) -> tuple[float, float]:
    """(θ − θ_0, σ) of a term's first number; a logarithm's is from no other absence than zero."""
    j = next(i for i, f in enumerate(fit.free) if f.term == name)
    f = fit.free[j]
    return float(fit.values[j]) - (0.0 if f.log else f.null), float(fit.std[j])


def _alone(recording: Recording, names: Sequence[str]) -> Estimate | None:
    try:
        return fit_greybox(recording, names)
    except RecordingError:
        return None
