"""Complete a diagnosis: confounded encoder scales, prediction errors that remain, and the verdict.

It is the last step of each diagnosis, by likelihood or by free-run prediction.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from heli3dof.axes import AXES
from heli3dof.diagnosis.base_parameters import OffNominal
from heli3dof.diagnosis.conclusion.confounded_encoder_scales import (
    undetectable_scales,
    with_scale_ties,
)
from heli3dof.diagnosis.result import (
    Diagnosis,
    Finding,
    Fitted,
    UnexplainedError,
    in_order_of_selection,
    physical,
)
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.gain import HORIZON_S, Gain
from heli3dof.integrity import Fault


def conclude(
    d: Diagnosis, axes: Sequence[str], *, detectable_offset_deg: float = math.inf
) -> Diagnosis:
    """Return the diagnosis ``d``, completed by these results:

    - the encoder scale errors that are confounded with a cause, or not identifiable
    - the prediction errors that the causes do not explain (`remainders`)
    - the verdict (`verdict_of`)

    If the extended model predicts much worse than a simulation with the profile's parameter values
    (`Fitted.predicts_worse`), its fit shows nothing about the rig. The result then has no causes,
    no base parameters off nominal and no residual torques.

    ``axes``: the measured axes. ``detectable_offset_deg``: smallest offset of the roll encoder that
    the recordings can show.
    """
    fitted = d.fitted
    assert fitted is not None
    if fitted.predicts_worse:
        d = replace(d, findings=(), calibration_findings=(), residual_torques=(), slow_noise=())
    profile = fitted.model.profile
    rest_rad, tolerance = float(profile.encoder.rest_rad[0]), profile.tolerance
    findings, off = with_scale_ties(
        d.findings, d.calibration_findings, fitted.calibration,
        rest_rad=rest_rad, tolerance=tolerance,
    )  # fmt: skip
    d = replace(d, findings=findings, calibration_findings=off)
    causes = in_order_of_selection(d.faults, findings, off)
    remaining = remainders(fitted, causes, d.slow_noise)
    undetectable = undetectable_scales(
        confounded_names(causes), axes,
        rest_rad=rest_rad, tolerance=tolerance, detectable_offset_deg=detectable_offset_deg,
    )  # fmt: skip
    verdict = verdict_of(causes, (*d.residual_torques, *remaining), fitted.refit)
    return replace(
        d, verdict=verdict, remainders=remaining,
        not_identifiable=without_causes((*d.not_identifiable, *undetectable), causes),
    )  # fmt: skip


def without_causes(
    names: Sequence[str], causes: Sequence[Fault | Finding | OffNominal]
) -> tuple[str, ...]:
    """Return the effects ``names`` that are not among the ``causes``.

    ``names``: effects not identifiable at their typical sizes. A larger one may still be a cause.
    """
    found = {c.term.name for c in physical(causes)}
    return tuple(name for name in names if name not in found)


def verdict_of(
    findings: Sequence[Fault | Finding | OffNominal],
    unexplained: Sequence[ResidualTorque | UnexplainedError],
    refit: Gain | None = None,
) -> str:
    """Return the verdict of a diagnosis: the first row of this table whose condition holds.

        unexplained         ``unexplained`` is not empty
        ambiguous           the first physical cause is confounded with another, or unconfirmed
        explained           there is a physical cause
        off_calibration     the refit removes most of the prediction error
        explained           there is a fault of a recording, such as sampling jitter
        nothing_found       otherwise

    ``findings``: all causes (`result.in_order_of_selection`). The causes selected later depend on
    the first, so its ambiguity makes the whole diagnosis ambiguous. Physical causes are
    properties of the rig. ``unexplained``: residual torques, and prediction errors that the causes
    do not explain. ``refit``: decrease of the prediction errors if the profile's base parameters
    are replaced by fitted values.
    """
    if unexplained:
        return "unexplained"
    causes = physical(findings)
    if not causes:
        if refit is not None and refit.removes_most_error:
            return "off_calibration"
        return "explained" if findings else "nothing_found"
    first = causes[0]
    unconfirmed = isinstance(first, Finding) and first.unconfirmed
    return "ambiguous" if first.tied_with or unconfirmed else "explained"


def remainders(
    f: Fitted,
    findings: Sequence[Fault | Finding | OffNominal],
    slow_noise: Sequence[ResidualTorque] = (),
) -> tuple[UnexplainedError, ...]:
    """Return the prediction errors that the diagnosis does not explain, largest first.

    The result is empty if the diagnosis explains most of the error. Let e_0 and e_1 be RMSEs of
    predictions of held-out data: e_0 by the model with the profile's parameters, e_1 by the
    extended model. e_n is the noise floor (0 if unknown), at most e_0. Most of the error remains
    if, with sums over the axes,

        Σ max(e_1² − e_n², 0) > ½ Σ e_0²

    The result then contains the axes that satisfy this inequality on their own. An axis is omitted
    if its noise floor is unknown and ``slow_noise`` contains a torque on it. Such a torque depends
    on time only, so no model can predict it.

    The result is also empty if the diagnosis offers no explanation: it found no physical cause, and
    refitting the profile's parameters does not remove most of the error on any axis.
    """
    if f.refit is None or not (physical(findings) or f.refit.removes_most_error):
        return ()
    each = []
    slow = {x.axis for x in slow_noise}
    for axis in AXES:
        e_0, e_1 = f.refit.before.get(axis), f.gain.after.get(axis)
        e_n = f.simulation_error.at(HORIZON_S, axis)[1]
        has_floor = math.isfinite(e_n)
        if axis in slow and not has_floor:
            continue
        if e_0 is not None and e_1 is not None and math.isfinite(e_0) and math.isfinite(e_1):
            each.append(UnexplainedError(axis, e_0, e_1, min(e_n, e_0) if has_floor else None))
    if sum(map(_unexplained, each)) <= sum(r.simulation_deg**2 for r in each) / 2:
        return ()
    most = (r for r in each if _unexplained(r) > r.simulation_deg**2 / 2)
    return tuple(sorted(most, key=_unexplained, reverse=True))


def _unexplained(r: UnexplainedError) -> float:
    """Return max(e_1² − e_n², 0) in deg²: the mean square error that remains unexplained.

    e_1 is the RMSE of the extended model, e_n the RMSE caused by noise (0 if unknown).
    """
    return float(max(r.extended_deg**2 - (r.noise_deg or 0.0) ** 2, 0.0))


def confounded_names(causes: Sequence[Fault | Finding | OffNominal]) -> tuple[str, ...]:
    """Return the names of the effects that the ``causes`` already cover.

    A fault of a recording covers the effect that it names, such as sampling jitter. Each other
    cause covers the effects that are confounded with it.
    """
    names: list[str] = []
    for f in causes:
        if isinstance(f, Fault):
            names.append(f"{f.effect}.{f.axis}")
        else:
            names += f.tied_with
    return tuple(names)
