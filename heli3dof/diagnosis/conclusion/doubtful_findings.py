"""Mark doubtful findings: as unconfirmed, or as confounded with another cause.

**Unconfirmed findings.** The report adds "-like" to the name of an unconfirmed finding. Its
confidence is at most `MOST_CONFIDENCE`. These findings are unconfirmed:

1. A finding whose size differs from zero by less than `SIGMAS_95` standard deviations, or that does
   not significantly increase the likelihood of held-out data.
2. `disturbance.periodic` at a frequency f of the commanded motion: the model's errors in that
   motion have the same period. f belongs to the motion if, on an axis, the spectral line at f
   contains at least the share `LEAST_SHARE` of the variance of x(t). x is the reference, or the
   angle if no references were logged:

       share(f) = 2 |mean (x − x̄) e^{−2πi f t}|² / var x

3. `mass.change` in a fit to several recordings, or at a constant voltage. A fit to several
   recordings has one instant of change, counted from each recording's first sample. It is unlikely
   that the mass changes at the same instant in every recording. A drift, such as warming motors,
   explains the data better. At a constant voltage, an added weight and a lower thrust have the same
   torque.
4. If the controller is unknown, a cause that single recordings do not confirm (see below). Without
   a controller no flights can be simulated, so no other test shows whether the cause is only a
   model error.

**Single recordings** (rule 4). The rig may change between recordings: for example, the motors are
warmer, or the battery is weaker. A joint fit to all recordings may attribute such changes to the
effects in the model. The standard errors of the joint fit do not allow for these changes. So
each recording is also fitted alone, with the same effects. θ is the first parameter of an effect,
and θ_0 its value without the effect. The fit to recording i gives the estimate θ_i with the
standard error σ_i. The recordings confirm the effect as a cause if both hold:

    significant:   |Σ (θ_i − θ_0)/σ_i²| ≥ `SIGMAS_95` √(Σ 1/σ_i²)
    of equal size: |θ_i − θ_j| ≤ `SIGMAS_997` √(σ_i² + σ_j²)     for all i, j

Recordings that cannot be fitted are ignored. If fewer than two are left, rule 4 marks no finding.
Rule 4 does not apply to a periodic torque or a change of mass. The fits to single recordings omit
both effects, because an ordinary fit cannot find the frequency or the instant. The diagnosis finds
them by a search over all frequencies and instants, which is not repeated for single recordings.

**Confounded findings.** If some segments of the flight favour cause a, and others cause b, the two
causes are confounded. Vuong's test (1989) shows this. It compares the fit with cause a and the
fit with cause b; neither model contains the other. The fits have the log-likelihoods ℓ_a, ℓ_b and
the scores S_a > S_b. A score is a gain in BIC (`search.select`). The flight is divided into C
segments of `CELL_S` seconds. d_c is the log-likelihood of segment c with cause a, minus that with
cause b. The standard deviation of 2 (ℓ_a − ℓ_b) is

    s = 2 √(C var d_c)

The difference S_a − S_b is used in place of 2 (ℓ_a − ℓ_b), because the scores are corrected for
bias and for the number of parameters. Φ((S_a − S_b)/s) is the probability that a is ranked
correctly above b. If it is below `LEVEL`, cause a is confounded with b. Otherwise the confidence in
a is at most this probability. The test is omitted if simulated flights decided the choice of cause
a (`search.rivals`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.base_parameters import effect_size
from heli3dof.diagnosis.constants import LEVEL, MAX_COMPARED, SIGMAS_95, SIGMAS_997
from heli3dof.diagnosis.result import Finding
from heli3dof.diagnosis.search.candidate_fits import CandidateFit
from heli3dof.diagnosis.search.select import Choice, with_ties
from heli3dof.diagnosis.validation.cross_validation import row_by_row
from heli3dof.diagnosis.validation.gain import CELL_S, gain_interval_positive
from heli3dof.distributions import normal_cdf
from heli3dof.errors import RecordingError
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.method import fit_greybox
from heli3dof.model.effects import term
from heli3dof.model.physics.parametrisation import first_parameters
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

LEAST_SHARE = 0.02
"""Least share of the variance at a frequency that belongs to the motion. Chosen; not derived."""
MOST_CONFIDENCE = 0.5
"""Largest confidence of a marked finding: as likely as not"""
MIN_SCORE_SHARE = 0.5
"""Least score of a candidate to compare, relative to the chosen cause's score. Chosen."""


def marked_if_doubtful(
    findings: Sequence[Finding], setup: Setup, fit: Estimate
) -> tuple[Finding, ...]:
    """Return the findings; the doubtful ones are marked as unconfirmed.

    The report adds "-like" to the name of an unconfirmed finding. These findings are doubtful:

    - a finding whose size in ``fit`` or whose gain on held-out data is not significant
    - a periodic torque whose frequency occurs in the commanded motion
    - a change of mass that was fitted to several recordings at once
    - a change of mass, if the motor voltages are constant in one of the recordings
    - any finding that the fits to single recordings do not confirm, if the controller is unknown
    """
    recordings, unconfirmed = setup.recordings, insignificant(fit)
    if not setup.controller_is_known:
        unconfirmed |= not_confirmed([f.term.name for f in findings], recordings)
    return tuple(
        marked_like(f)
        if f.term.name in unconfirmed
        or not gain_interval_positive(f.gain)
        or _is_doubtful(f, recordings)
        else f
        for f in findings
    )


def insignificant(fit: Estimate) -> set[str]:
    """Return the terms whose first parameter is within `SIGMAS_95` σ of having no effect."""
    sizes = {name: effect_size(fit, name) for name in first_parameters(fit.free)}
    return {name for name, s in sizes.items() if s and abs(s[0]) < SIGMAS_95 * s[1]}


def marked_like(f: Finding) -> Finding:
    """Return the finding, marked as unconfirmed; its confidence is limited to `MOST_CONFIDENCE`."""
    confidence = min(f.choice.confidence, MOST_CONFIDENCE)
    return replace(f, unconfirmed=True, choice=replace(f.choice, confidence=confidence))


def _is_doubtful(f: Finding, recordings: Sequence[Recording]) -> bool:
    name = f.term.effect.name
    if name == "mass.change":
        return len(recordings) > 1 or any(constant_voltage(r) for r in recordings)
    if name == "disturbance.periodic":
        return any(is_in_motion(r, f.values["frequency_Hz"][0]) for r in recordings)
    return False


def constant_voltage(recording: Recording) -> tuple[int, int] | None:
    """Return (first, last) row with both motors on, if their voltages are constant and equal.

    Otherwise, or if the motors are switched off in between, the result is None.
    """
    V = recording.voltage
    on = np.flatnonzero((V > 0).all(axis=1))
    if not len(on) or np.ptp(V[on]) > 1e-9 or on[-1] - on[0] + 1 != len(on):
        return None
    return int(on[0]), int(on[-1])


def is_in_motion(recording: Recording, frequency_Hz: float) -> bool:
    """Return whether the commanded motion has a spectral line at the frequency, on any axis.

    A spectral line must contain at least the share `LEAST_SHARE` of the motion's variance. The
    commanded motion is given by the references or, if none were logged, by the angles.
    """
    r = recording
    x = r.reference if np.isfinite(r.reference).any() else r.angle
    return any(line_share(r.t, x[:, i], frequency_Hz) >= LEAST_SHARE for i in range(x.shape[1]))


def line_share(t: np.ndarray, x: np.ndarray, frequency_Hz: float) -> float:
    """Return the share of x's variance in the spectral line at a frequency; 0 for constant x.

    x (N,) is sampled at the times t (N,), in s.
    """
    finite = np.isfinite(x)
    if finite.sum() < 2:
        return 0.0
    t, x = t[finite], x[finite] - x[finite].mean()
    power = float(x @ x) / len(x)
    if power <= 1e-12:
        return 0.0
    line = np.mean(x * np.exp(-2j * np.pi * frequency_Hz * t))
    return float(2 * abs(line) ** 2 / power)


def not_confirmed(names: Sequence[str], recordings: Sequence[Recording]) -> set[str]:
    """Return the terms that the recordings, each fitted alone, do not confirm.

    The sizes of such a term differ between recordings, or their mean is not significant
    (`confirmed`). A periodic torque and a change of mass are not tested: a fit to one recording
    cannot find their frequency or instant.
    """
    tested = [n for n in names if not term(n).effect.scan]
    if len(recordings) < 2 or not tested:
        return set()
    n = len(recordings)
    results = parallel_map(lambda i: _fit_alone(recordings[i], tested), n, what="recordings alone")
    fits = [f for f in results if f is not None]
    if len(fits) < 2:
        return set()
    return {n for n in tested if not confirmed([size(f, n) for f in fits])}


def confirmed(sizes: Sequence[tuple[float, float]]) -> bool:
    """Return whether sizes (θ − θ_0, σ), one per recording, agree and their mean is significant.

    The mean is weighted by 1/σ².

    >>> confirmed([(0.9, 0.8), (1.9, 1.4), (10.0, 6.5)])  # the mean is 1.8 σ
    False
    >>> confirmed([(2.2, 0.3), (1.0, 2.0)]), confirmed([(2.2, 0.3), (-2.0, 0.3)])
    (True, False)
    """
    d, s = np.array([size for size in sizes if size[1] > 0]).reshape(-1, 2).T
    significant = abs(np.sum(d / s**2)) > SIGMAS_95 * np.sqrt(np.sum(s**-2.0))
    return bool(significant) and all(
        are_of_equal_size(*pair) for pair in itertools.combinations(sizes, 2)
    )


def are_of_equal_size(a: tuple[float, float], b: tuple[float, float]) -> bool:
    """Return whether estimates (value, σ) differ by at most `SIGMAS_997` σ of the difference."""
    return abs(a[0] - b[0]) <= SIGMAS_997 * math.hypot(a[1], b[1])


def size(fit: Estimate, name: str) -> tuple[float, float]:
    """Return (θ − θ_0, σ): the size of a term in ``fit``, and its standard deviation.

    θ ± σ is the estimate of the term's first parameter. Usually, θ_0 is the value at which the term
    has no effect. A parameter that is fitted on a logarithmic scale has no such value. For it, the
    function returns θ itself (θ_0 = 0).
    """
    j = first_parameters(fit.free)[name]
    return effect_size(fit, name) or (float(fit.values[j]), float(fit.std[j]))


def _fit_alone(recording: Recording, names: Sequence[str]) -> Estimate | None:
    try:
        return fit_greybox(recording, names)
    except RecordingError:
        return None


def with_segment_ties(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Return the findings after Vuong's test of each against other causes.

    The search for causes fitted the model with each of several candidates, and chose one of them as
    the finding. Vuong's test compares the log-likelihoods of two of these fits in segments of the
    flight. If different segments favour different causes, the function adds the other cause to the
    finding's ``tied_with``. Otherwise it may lower the finding's confidence. A finding is not
    tested if the search chose it by another test, which simulates flights (`search.rivals`).
    """
    adopted = {f.term.name for f in findings}
    return tuple(
        replace(f, choice=tied_by_segments(f.choice, adopted)) if not f.choice.by_flights else f
        for f in findings
    )


def tied_by_segments(choice: Choice, adopted: set[str]) -> Choice:
    """Compare a chosen cause with other candidates by Vuong's test; return the updated ``choice``.

    Vuong's test compares the log-likelihoods of two fits in segments of the flight. One fit
    contains the chosen cause. The other contains, in its place, a candidate of the same selection
    step. The test gives the probability that the chosen cause is ranked correctly above the
    candidate (`ranking_probability`). If this probability is below `LEVEL`, the function adds the
    candidate to ``tied_with``. Otherwise it limits the confidence in the cause to this probability.

    Candidates that are themselves among the ``adopted`` causes are not compared, because the final
    model contains both.
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
        if probability < LEVEL:
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
    """Return s = 2 √(C var d), the standard deviation of 2 Σ d.

    The flight is divided into C segments. d (C,) contains for each segment the log-likelihood with
    one cause minus that with another cause. So 2 Σ d is the difference in 2 ln L for the whole
    flight. var d is the mean of (d − mean d)².

    >>> ranking_std(np.array([1.0, -1.0, 1.0, -1.0]))
    4.0
    """
    return float(2 * np.sqrt(len(d) * d.var()))


def ranking_probability(difference: float, s: float) -> float:
    """Return Φ(Δ/s): the probability that two causes are ranked correctly by their scores.

    Δ = ``difference`` ≥ 0 is the higher score minus the lower one, and ``s`` is the standard
    deviation of Δ. The ranking is correct if the expected value of Δ is positive.

    >>> round(ranking_probability(20.0, 20.0), 2), ranking_probability(1.0, 0.0)
    (0.84, 1.0)
    """
    return float(normal_cdf(difference / s)) if s > 0 else float(difference > 0)
