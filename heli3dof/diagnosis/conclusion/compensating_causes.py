"""Search for residual torques, and drop the causes that only compensate for such a torque.

A cause counts as compensating if a formula of the torque explains the flight better than the cause
does (`conclusion.formula_contest`). Such causes are removed. The others are fitted again,
and adopted or dropped. The search is repeated until no further cause is removed.

A remaining cause is marked "…-like" (unconfirmed) if one of these holds:

- Its size differs from zero by less than `SIGMAS_95` standard deviations.
- It does not significantly improve the prediction of held-out data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from heli3dof.diagnosis.base_parameters import effect_size
from heli3dof.diagnosis.conclusion.adoption import AdoptionResult, adopted
from heli3dof.diagnosis.conclusion.formula_contest import replaced_by_formula
from heli3dof.diagnosis.conclusion.unknown_controller import is_biased
from heli3dof.diagnosis.constants import SIGMAS_95
from heli3dof.diagnosis.result import COMPENSATES, Dropped, Finding
from heli3dof.diagnosis.selection.steps import bias_corrected, without
from heli3dof.diagnosis.unmodelled.torque_evidence import evidence
from heli3dof.diagnosis.unmodelled.torque_formula import significant_formula
from heli3dof.diagnosis.unmodelled.unmodelled_torque import (
    ResidualTorque,
    significant_torques,
    split_off_slow_noise,
)
from heli3dof.diagnosis.validation.gain import gain_interval_positive
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.model.physics.parametrisation import first_parameters
from heli3dof.recording.recording import Recording


def search_residual_torques(
    setup: Setup, start: AdoptionResult, holdout: Sequence[Recording], *, flights: int
) -> AdoptionResult:
    """Search the fit of ``start`` for residual torques; drop causes that only compensate for them.

    ``flights``: number of flights simulated without residual torque, per search.
    """
    if not start.fit.is_corrected:  # a cause that is now dropped may have prevented simulation
        again = bias_corrected(setup, start.fit.problem, start.fit.optimum)
        start = (
            start if not again.is_corrected else _adopted_again(setup, start, again, (), holdout)
        )
    now, removed, proven = start, list[Finding](), None
    first: tuple[ResidualTorque, ...] | None = None
    while True:
        scores = evidence(now.fit, setup.recordings, flights=flights, seed=setup.seed)
        if scores.null is None and proven is None:
            proven = significant_formula(scores)
        left, slow_noise = split_off_slow_noise(significant_torques(scores, proven))
        left = tuple(x for x in left if x.axis in setup.explained_axes)
        if not now.fit.is_corrected:
            left = tuple(x for x in left if not is_biased(now.fit, x.axis))
        causes = replaceable_causes(now.findings)
        contest = replaced_by_formula(setup, now.fit, causes, holdout)
        if contest is None:
            break
        names, proven = contest.causes, contest.formula.location
        first = left if first is None else first
        removed += [f for f in now.findings if f.term.name in names]
        now = _without(setup, now, names, holdout)
    if first is not None and not left:
        return _undecided(start, first, removed)
    return replace(
        now,
        findings=marked_unconfirmed(now.findings, now.fit),
        residual_torques=with_resemblance(left, removed),
        slow_noise=slow_noise,
    )


def replaceable_causes(findings: Sequence[Finding]) -> list[str]:
    """Return the names of causes that are no part of the rigid body's equations."""
    return [f.term.name for f in findings if not f.term.effect.of_base]


def _undecided(
    start: AdoptionResult, left: tuple[ResidualTorque, ...], removed: Sequence[Finding]
) -> AdoptionResult:
    """Return ``start`` with all its causes marked "…-like", and with the residual torques ``left``.

    A formula explained the flight better than the causes ``removed``, but in the model without
    these causes no residual torque is significant. So all causes and torques are uncertain.
    ``left``: torques of the first search.
    """
    findings = tuple(replace(f, unconfirmed=True) for f in start.findings)
    return replace(
        start,
        findings=findings,
        residual_torques=with_resemblance(left, removed),
        is_decided=False,
    )


def _without(
    setup: Setup, now: AdoptionResult, names: Sequence[str], holdout: Sequence[Recording]
) -> AdoptionResult:
    """Return ``now`` after removing the causes ``names``; the others are refitted and tested."""
    found = now.fit
    for f in now.findings:
        if f.term.name in names:
            found = without(found, f.term.name)
    again = bias_corrected(setup, found.problem, found.optimum)
    return _adopted_again(setup, now, again, names, holdout)


def _adopted_again(
    setup: Setup, now: AdoptionResult, found: CorrectedFit, names: Sequence[str],
    holdout: Sequence[Recording],
) -> AdoptionResult:  # fmt: skip
    """Return the adoption result for ``found``, the fit of ``now`` without the causes ``names``.

    `adopted` decides again on each remaining cause. The result lists ``names`` as dropped, with the
    gains that they had in ``now``.
    """
    kept = [f.choice for f in now.findings if f.term.name not in names]
    gains = {f.term.name: f.gain for f in now.findings}
    result = adopted(found, kept, holdout, seed=setup.seed)
    replaced = (Dropped(n, gains[n], COMPENSATES) for n in names)
    return replace(result, dropped=(*now.dropped, *replaced, *result.dropped))


def marked_unconfirmed(findings: Sequence[Finding], fit: Estimate) -> tuple[Finding, ...]:
    """Return the findings; the unconfirmed ones are marked "…-like".

    A finding is unconfirmed if its size in ``fit`` is `insignificant`, or if it does not
    significantly improve the prediction of held-out data.
    """
    small = insignificant(fit)
    return tuple(
        replace(f, unconfirmed=f.term.name in small or not gain_interval_positive(f.gain))
        for f in findings
    )


def insignificant(fit: Estimate) -> set[str]:
    """Return the terms whose first parameter is within `SIGMAS_95` σ of having no effect."""
    sizes = {name: effect_size(fit, name) for name in first_parameters(fit.free)}
    return {name for name, s in sizes.items() if s and abs(s[0]) < SIGMAS_95 * s[1]}


def with_resemblance(
    residuals: Sequence[ResidualTorque], causes: Sequence[Finding]
) -> tuple[ResidualTorque, ...]:
    """Return ``residuals``, with the text ``resembles`` set on the first residual torque.

    The text, such as "motor.delay-like", names the first of ``causes`` and the causes confounded
    with it: the torque resembles their effects. An existing text is kept.
    """
    if not residuals or residuals[0].resembles is not None or not causes:
        return tuple(residuals)
    names = (causes[0].term.name, *causes[0].tied_with)
    resembles = " or ".join(f"{name}-like" for name in names)
    return (replace(residuals[0], resembles=resembles), *residuals[1:])
