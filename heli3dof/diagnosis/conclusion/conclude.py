"""Complete a diagnosis: confounded encoder scales, what remains unexplained, and the verdict.

It is the last step for every log, with or without a likelihood.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from heli3dof.diagnosis.base_parameters import OffNominal
from heli3dof.diagnosis.conclusion.encoder_scales import undetectable_scales, with_scale_ties
from heli3dof.diagnosis.result import (
    Diagnosis,
    Finding,
    confounded_names,
    physical,
    remainders,
    verdict_of,
)
from heli3dof.integrity import Fault


def conclude(
    d: Diagnosis, axes: Sequence[str], *, level_deg: float = math.inf,
    ambiguous_if_unconfirmed: bool = False,
) -> Diagnosis:  # fmt: skip
    """Return ``d`` with its verdict, the errors that remain and confounded encoder scales.

    ``axes``: the measured axes; ``level_deg``: least detectable roll offset.
    ``ambiguous_if_unconfirmed``: the verdict is "ambiguous" if the first cause is unconfirmed
    ("…-like").
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
        rest_rad=rest_rad, tolerance=tolerance, level_deg=level_deg,
    )  # fmt: skip
    unconfirmed = any(isinstance(f, Finding) and f.unconfirmed for f in physical(causes)[:1])
    verdict = verdict_of(
        causes,
        (*d.residual_torques, *remaining),
        fitted.refit,
        ambiguous=unconfirmed and ambiguous_if_unconfirmed,
    )
    return replace(
        d, verdict=verdict, remainders=remaining,
        not_identifiable=without_causes((*d.not_identifiable, *undetectable), causes),
    )  # fmt: skip


def without_causes(
    names: Sequence[str], causes: Sequence[Fault | Finding | OffNominal]
) -> tuple[str, ...]:
    """Return the effects ``names`` without those that are ``causes``.

    ``names``: effects not identifiable at their typical sizes. A larger one may still be a cause.
    """
    found = {c.term.name for c in physical(causes)}
    return tuple(name for name in names if name not in found)
