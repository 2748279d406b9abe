"""Test whether the segments of a flight agree on which of two causes is likelier (Vuong 1989).

The causes a and b are not nested. Their fits have log-likelihoods ℓ_a, ℓ_b and scores S_a > S_b
(`selection.select`). The C cells are segments of `CELL_S` seconds. With d_c the difference of the
log-likelihoods in cell c, the standard deviation of 2 (ℓ_a − ℓ_b) is

    s = 2 √(C var d_c)

The difference S_a − S_b is used in place of 2 (ℓ_a − ℓ_b), because the scores are corrected for
bias and for the number of parameters. If S_a − S_b < `MIN_CLEARANCE` · s, cause a is confounded
with b. Otherwise the confidence in a is at most Φ((S_a − S_b)/s). Causes compared by simulated
flights (`selection.rivals`) are not tested.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.constants import MAX_COMPARED
from heli3dof.diagnosis.result import Finding
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit
from heli3dof.diagnosis.selection.select import Choice, with_ties
from heli3dof.diagnosis.validation.cross_validation import row_by_row
from heli3dof.diagnosis.validation.gain import CELL_S
from heli3dof.parallel import parallel_map

MIN_CLEARANCE = 1.0
"""Least difference of the scores that separates two causes, in units of s. Chosen; not derived."""
MIN_SCORE_SHARE = 0.5
"""Share of the first cause's score below which a cause is not compared. Chosen."""


def with_segment_ties(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Return the findings, with further confounded causes in their ``tied_with``.

    The segments of the flight do not separate these causes from the finding.
    """
    adopted = {f.term.name for f in findings}
    return tuple(
        replace(f, choice=tied_by_segments(f.choice, adopted)) if not f.choice.by_flights else f
        for f in findings
    )


def tied_by_segments(choice: Choice, adopted: set[str]) -> Choice:
    """Return the choice, with further confounded candidates in its ``tied_with``.

    Vuong's test does not separate these candidates from the choice. It compares log-likelihoods in
    segments of the flight. The ``adopted`` causes are not tested.
    """
    best, *others = choice.candidates
    if best.term.effect.of_base:
        return choice
    compared = [
        c
        for c in others
        if MIN_SCORE_SHARE * best.score < c.score < best.score
        and c.term.name not in (*choice.tied_with, *adopted)
        and not c.term.effect.formal
    ][:MAX_COMPARED]
    if not compared:
        return choice
    by_cell = parallel_map(lambda i: log_likelihood_cells([best, *compared][i]), len(compared) + 1)
    tied, confidence = [], choice.confidence
    for c, d in zip(compared, by_cell[1:], strict=True):
        probability = ranking_probability(best.score - c.score, ranking_std(by_cell[0] - d))
        if probability < ranking_probability(MIN_CLEARANCE, 1.0):
            tied.append(c.term.name)
        else:
            confidence = min(confidence, probability)
    return with_ties(replace(choice, confidence=confidence), tied)


def log_likelihood_cells(c: CandidateFit) -> np.ndarray:
    """Return the log-likelihood (C,) of a candidate's fit in each segment of `CELL_S` seconds."""
    data = c.problem.data
    X = c.problem.run(c.optimum.theta, c.optimum.noise, keep=3).X
    assert X is not None
    n = max(1, round(CELL_S / float(np.median(data.h))))
    rows = row_by_row(data, X).sum(axis=1)
    return np.add.reduceat(rows, np.arange(0, len(rows), n))


def ranking_std(d: np.ndarray) -> float:
    """Return s, the standard deviation of 2 Σ d for the cells' log-likelihood differences d (C,).

    >>> ranking_std(np.array([1.0, -1.0, 1.0, -1.0]))
    4.0
    """
    return float(2 * np.sqrt(len(d) * d.var()))


def ranking_probability(difference: float, s: float) -> float:
    """Return Φ(Δ/s), the confidence in the higher of two scores with the difference Δ ± s.

    >>> round(ranking_probability(20.0, 20.0), 2), ranking_probability(1.0, 0.0)
    (0.84, 1.0)
    """
    from scipy.stats import norm

    return float(norm.cdf(difference / s)) if s > 0 else float(difference > 0)
