"""Mark unconfirmed causes as "…-like".

A cause is unconfirmed if one of these holds:

- Its size differs from zero by less than `SIGMAS_95` standard deviations.
- It does not significantly improve the prediction of held-out data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from heli3dof.diagnosis.base_parameters import effect_size
from heli3dof.diagnosis.constants import SIGMAS_95
from heli3dof.diagnosis.result import Finding
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.gain import pays
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.model.physics.parametrisation import first_parameters


def marked_unconfirmed(findings: Sequence[Finding], fit: Estimate) -> tuple[Finding, ...]:
    """Return the findings; the unconfirmed ones are marked "…-like"."""
    small = insignificant(fit)
    return tuple(replace(f, unconfirmed=f.term.name in small or not pays(f.gain)) for f in findings)


def insignificant(fit: Estimate) -> set[str]:
    """Return the terms whose first parameter is within `SIGMAS_95` σ of having no effect."""
    sizes = {name: effect_size(fit, name) for name in first_parameters(fit.free)}
    return {name for name, s in sizes.items() if s and abs(s[0]) < SIGMAS_95 * s[1]}


def with_resemblance(
    residuals: Sequence[ResidualTorque], causes: Sequence[Finding]
) -> tuple[ResidualTorque, ...]:
    """Return the residual torques; if ``resembles`` of the first is None, it is set to a text.

    The text names the first cause and those confounded with it, such as "motor.delay-like".
    """
    if not residuals or residuals[0].resembles is not None or not causes:
        return tuple(residuals)
    names = (causes[0].term.name, *causes[0].tied_with)
    resembles = " or ".join(f"{name}-like" for name in names)
    return (replace(residuals[0], resembles=resembles), *residuals[1:])
