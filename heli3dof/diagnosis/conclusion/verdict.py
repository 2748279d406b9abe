"""Complete a diagnosis: confounded encoder scales, what remains unexplained, and the verdict.

It is the last step for every log, with or without a likelihood.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from heli3dof.axes import AXES
from heli3dof.diagnosis.base_parameters import OffNominal
from heli3dof.diagnosis.conclusion.confounded_parameters import undetectable_scales, with_scale_ties
from heli3dof.diagnosis.result import (
    Diagnosis,
    Finding,
    Fitted,
    UnexplainedError,
    physical,
)
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.gain import HORIZON_S, Gain
from heli3dof.integrity import Fault


def conclude(
    d: Diagnosis, axes: Sequence[str], *, detectable_offset_deg: float = math.inf
) -> Diagnosis:
    """Return ``d`` with its verdict, the errors that remain and confounded encoder scales.

    ``axes``: the measured axes; ``detectable_offset_deg``: least detectable roll offset.
    """
    fitted = d.fitted
    assert fitted is not None
    profile = fitted.model.profile
    rest_rad, tolerance = float(profile.encoder.rest_rad[0]), profile.tolerance
    findings, off = with_scale_ties(
        d.findings, d.calibration_findings, fitted.calibration,
        rest_rad=rest_rad, tolerance=tolerance,
    )  # fmt: skip
    d = replace(d, findings=findings, calibration_findings=off)
    causes = d.in_order
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
    left: Sequence[ResidualTorque | UnexplainedError],
    refit: Gain | None = None,
) -> str:
    """Return the verdict, such as "explained", on the ``findings`` in the order of `in_order`.

    ``left``: the residual torques, and the errors that the causes leave (`remainders`).
    ``refit``: the gain of refitting the profile's numbers. The verdict is "ambiguous" if the first
    physical cause is confounded or unconfirmed ("…-like"). Faults of a recording affect the verdict
    only if there is no physical cause.
    """
    if left:
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
    """Return the errors that remain, largest first; empty if the causes explain most of the error.

    On held-out data, e_0 is the RMSE of the simulation with the profile's numbers and e_1 that of
    the extended model; e_n is the noise floor (0 if unknown), limited to e_0. Most of the error
    remains if, with sums over the axes,

        Σ max(e_1² − e_n², 0) > ½ Σ e_0²

    The result contains the axes that satisfy this inequality on their own. An axis with slow noise
    and without a noise floor is left out. Without a physical cause, and if refitted numbers do not
    improve predictions either, there is no claim to refute, so the result is empty.
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
    """Return the mean square in deg² that neither the extended model nor noise explains."""
    return float(max(r.extended_deg**2 - (r.noise_deg or 0.0) ** 2, 0.0))


def confounded_names(causes: Sequence[Fault | Finding | OffNominal]) -> tuple[str, ...]:
    """Return the names of effects that a diagnosis must not report as causes of their own.

    A fault of the recording (such as an encoder offset) explains them, or they are confounded with
    one of the ``causes``.
    """
    names: list[str] = []
    for f in causes:
        if isinstance(f, Fault):
            names.append(f"{f.effect}.{f.axis}")
        else:
            names += f.tied_with
    return tuple(names)
