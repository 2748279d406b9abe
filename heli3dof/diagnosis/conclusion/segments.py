"""Whether a flight's own pieces agree on which of two causes it is.

Two causes with full fits of log-likelihoods ℓ_a and ℓ_b, neither a case of the other: where they
are nearly alike, 2 (ℓ_a − ℓ_b) scatters from flight to flight by more than chance does to nested
ones, and by how much a flight's pieces tell (Vuong 1989). With d_c the difference in each of C
cells of `CELL_S`,

    s = 2 √(C var d_c)

the second is tied with the first where 2 (ℓ_a − ℓ_b) < `AGREED` s, else the first is no surer than
Φ(2 (ℓ_a − ℓ_b)/s). For 2 (ℓ_a − ℓ_b) stands the difference of the scores
(`selection.select`), freed of false slopes and less the price of a cause's numbers.

Where flights of each cause were asked (`selection.rivals`) they know better.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.result import Finding
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit
from heli3dof.diagnosis.selection.select import Choice
from heli3dof.diagnosis.validation.cross_validation import row_by_row
from heli3dof.parallel import parallel_map

CELL_S = 0.5
AGREED = 1.0
NEAR = 0.5
"""Of the first one's score: what scores less is not asked."""
ASKED = 3


def with_segment_ties(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """The findings, each tied too with what the pieces do not surely tell from it."""
    here = {f.choice.term.name for f in findings}
    return tuple(
        replace(f, choice=tied_by_segments(f.choice, here)) if not f.choice.by_flights else f
        for f in findings
    )


def tied_by_segments(choice: Choice, here: set[str]) -> Choice:
    """The choice, tied too with what the pieces do not surely tell from it, but those ``here``."""
    best, *others = choice.contenders
    if best.term.effect.of_base:
        return choice
    asked = [
        c
        for c in others
        if NEAR * best.score < c.score < best.score
        and c.term.name not in (*choice.tied_with, *here)
        and not c.term.effect.formal
    ][:ASKED]
    if not asked:
        return choice
    each = parallel_map(lambda i: cells([best, *asked][i]), len(asked) + 1)
    tied, sure = list(choice.tied_with), choice.confidence
    for c, d in zip(asked, each[1:], strict=True):
        certain = sureness(best.score - c.score, scatter(each[0] - d))
        if certain < sureness(AGREED, 1.0):
            tied.append(c.term.name)
        else:
            sure = min(sure, certain)
    return replace(choice, tied_with=tuple(tied), confidence=sure)


def cells(c: CandidateFit) -> np.ndarray:
    """(C,) the log-likelihood of each cell."""
    data = c.problem.data
    X = c.problem.run(c.optimum.theta, c.optimum.noise, keep=3).X
    assert X is not None
    n = max(1, round(CELL_S / float(np.median(data.h))))
    each = row_by_row(data, X).sum(axis=1)
    return np.add.reduceat(each, np.arange(0, len(each), n))


def scatter(d: np.ndarray) -> float:
    """s, from the differences d (C,) of the cells.

    >>> scatter(np.array([1.0, -1.0, 1.0, -1.0]))
    4.0
    """
    return float(2 * np.sqrt(len(d) * d.var()))


def sureness(apart: float, s: float) -> float:
    """Φ(Δ/s), of scores that are Δ apart.

    >>> round(sureness(20.0, 20.0), 2), sureness(1.0, 0.0)
    (0.84, 1.0)
    """
    from scipy.stats import norm

    return float(norm.cdf(apart / s)) if s > 0 else float(apart > 0)
