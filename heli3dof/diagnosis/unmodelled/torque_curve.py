"""What a person sees a cause in: residual torque against the variable that the cause depends on.

The rig of the final fit *without* the one cause is filtered with the noise of the fit that lacked
it; its residual torque τ̂ (`sensitivity.residual_torque`) is the recordings' own estimate of the
torque of the cause. It is averaged in bins of the variable z; each bin's error bar is

    σ = std(τ̂)/√(T/`WINDOW_S`),     T the bin's time: what lies within `WINDOW_S` counts once

Through it goes the fitted cause: τ = B⁻¹ (q̈ with it − q̈ without it) along the same states, which
serves effects of any stage that acts, a lag or a dead zone as well as a friction. A wrong zero or
scale of an encoder acts on nothing: it misleads. There the rig *with* it is filtered too, and

    τ = B⁻¹ (∂y/∂q q̈(x_with) − q̈(x_without)),      y the reading

is what the rig that does not know of it lacks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.sensitivity.residual_torque import UNITS, Trail, along, trail, trail_at
from heli3dof.diagnosis.unmodelled.unmodelled_torque import WINDOW_S, ResidualTorque
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.model.effects import Effect, Term
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.model.physics.state_layout import Stage

BINS = 24
LEAST_TIME_S = 0.1
"""A bin of less than this tells nothing."""
DEPENDS_ON = {
    "friction.coulomb": "{axis}_rate", "friction.viscous": "{axis}_rate",
    "drag.quadratic": "{axis}_rate", "stiffness.pendulum": "{axis}", "stiffness.cable": "yaw",
    "bias.torque": "time", "inertia": "{axis}", "mass.imbalance": "roll", "mass.change": "time",
    "motor.spin_up": "voltage_difference_slope", "motor.dead_zone": "voltage_sum",
    "motor.thrust_curve": "voltage_sum", "motor.rotor_curve": "voltage_sum",
    "motor.thrust_gain": "voltage_sum", "motor.thrust_mismatch": "voltage_sum",
    "motor.saturation": "voltage_sum", "motor.supply_sag": "voltage_sum",
    "aero.ground_effect": "roll", "aero.reaction_torque": "voltage_difference",
    "aero.inflow": "roll_rate", "aero.gyroscopic": "roll_rate",
    "disturbance.periodic": "time",
}  # fmt: skip
"""Effect → the variable it is seen in, where the effect itself does not say (``evidence``)."""
PLAY = "encoder.backlash"
"""It hides the motion and has no torque that a variable tells."""
LATE = {"motor.lag": "voltage_difference_slope", "motor.delay": "voltage_difference_slope"}
"""What comes late is no function of the voltage: τ K_f dV/dt is what is missing meanwhile."""


VOLTAGES = ("voltage_sum", "voltage_difference", "voltage_front", "voltage_back")
OTHERS = ("roll", "pitch", *VOLTAGES[:2])
"""Where a torque that follows a voltage may be seen better, once the trim has taken its part."""
INSTEAD = {
    **dict.fromkeys(VOLTAGES, OTHERS),
    "voltage_difference_slope": ("voltage_sum_slope",),  # what comes late on roll
}
CLEARER = 2.0


@dataclass(frozen=True, eq=False)
class Evidence:
    """Residual torque on ``axis`` in m bins of a variable, and the fitted cause through it."""

    name: str
    """The cause's"""
    axis: str
    depends_on: str
    unit: str
    """In which z is given: degrees and degrees a second for angles and rates"""
    z: np.ndarray
    torque: np.ndarray
    std: np.ndarray
    """(m,) N·m"""
    curve_z: np.ndarray
    curve: np.ndarray
    """(c,) N·m: the fitted cause, its mean where it is no function of z alone"""


def variable_of(effect: Effect, axis: str | None) -> str | None:
    """One of `UNITS`; None for an effect that shows in no torque (play in an encoder, timing)."""
    if not effect.hooks or effect.name == PLAY:
        return None
    said = LATE.get(effect.name) or getattr(effect, "evidence", "") or DEPENDS_ON.get(effect.name)
    if not isinstance(said, str) or not said:
        return None
    name = said.replace("{axis}", axis or "roll")
    if name in ("rate", "angle") and axis is not None:
        name = f"{axis}_rate" if name == "rate" else axis
    return name if name in UNITS else None


def evidence(found: Estimate, term: Term, noise: np.ndarray) -> Evidence | None:
    """Of one term of ``found``; ``noise`` (4,) is that of the fit without it.

    None for an effect that is seen in no torque.
    """
    name = variable_of(term.effect, term.axis)
    if name is None:
        return None
    keep = tuple(t for t in found.structure.terms if t.name != term.name)
    lacking = replace(found.problem, structure=Structure(found.structure.profile, keep))
    given = dict(zip(found.structure.names, found.values.tolist(), strict=True))
    theta = lacking.coordinates(lacking.structure.values_of(given))
    flight = trail_at(lacking, theta, noise)
    misleads = Stage.MEASURE in term.effect.hooks
    if misleads:
        knowing = trail_at(found.problem, found.optimum.theta, found.optimum.noise)
        with_it = knowing.slope * knowing.q_ddot
    else:
        with_it = along(found.problem, found.optimum.theta, flight.X)[3]
    cause = flight.as_torque(with_it - flight.q_ddot)
    if term.axis is not None and not misleads:
        i = AXES.index(term.axis)
    else:
        others = () if misleads else INSTEAD.get(name, ())
        name, i = _clearest(flight, cause, (name, *others))
    z = flight.variable(name)
    unit = UNITS[name]
    frequency = given.get(f"{term.name}.frequency_Hz")
    if name == "time" and frequency:
        z, name, unit = (z * frequency) % 1.0, f"phase of {frequency:.3g} Hz", "turns"
    rows = flight.flown & np.isfinite(flight.torque[:, i])
    z = _read(z, unit)[rows]
    curve_z, curve, _ = _binned(z, cause[rows, i], flight.data.h[rows], 3 * BINS)
    return Evidence(
        term.name, AXES[i], name, unit,
        *_binned(z, flight.torque[rows, i], flight.data.h[rows], BINS), curve_z, curve,
    )  # fmt: skip


def leftover_evidence(found: Estimate, rest: ResidualTorque) -> Evidence:
    """Of a leftover: the residual torque of the fit that it is left over from."""
    flight = trail(found)
    i = AXES.index(rest.axis)
    rows = flight.flown & np.isfinite(flight.torque[:, i])
    unit = UNITS[rest.depends_on]
    z = _read(flight.variable(rest.depends_on), unit)[rows]
    knots, torque = np.array(rest.table).T
    slope = float(np.polyfit(_read(knots, unit), torque, 1)[0])
    name = f"Unmodelled {rest.axis} torque, slope {slope:.3g} N·m/({unit}),".replace("-", "−")
    return Evidence(
        name, rest.axis, rest.depends_on, unit,
        *_binned(z, flight.torque[rows, i], flight.data.h[rows], BINS), _read(knots, unit), torque,
    )  # fmt: skip


def _clearest(flight: Trail, cause: np.ndarray, names: Sequence[str]) -> tuple[str, int]:
    """The variable and axis in which the points follow the cause's bins best, in error bars:

    Σ (τ̂ − mean)²/σ² − Σ (τ̂ − τ − mean)²/σ²

    The mean does not count: a constant is what the base's trim takes. Another variable than the
    first of ``names`` is taken where it is `CLEARER`: a dead zone is a torque on yaw that follows
    pitch, once the trim has taken the rest of it.
    """
    best = (names[0], 0, 0.0)
    for name in dict.fromkeys(names):
        z = flight.variable(name)
        for i in range(3):
            rows = flight.flown & np.isfinite(flight.torque[:, i])
            if not rows.any():
                continue
            h = flight.data.h[rows]
            _, mean, _ = _binned(z[rows], cause[rows, i], h, BINS)
            _, torque, std = _binned(z[rows], flight.torque[rows, i], h, BINS)
            weight = 1 / np.maximum(std, 1e-12) ** 2
            clear = _about_mean(torque, weight) - _about_mean(torque - mean, weight)
            if clear > best[2] * (1.0 if name == best[0] else CLEARER):
                best = (name, i, clear)
    return best[0], best[1]


def _about_mean(x: np.ndarray, weight: np.ndarray) -> float:
    return float(np.sum(weight * (x - np.average(x, weights=weight)) ** 2))


def _binned(
    z: np.ndarray, torque: np.ndarray, h: np.ndarray, bins: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(z, mean, standard error) of bins of equal width between the outermost 0.2 %."""
    low, high = np.quantile(z, [0.002, 0.998])
    which = np.clip(((z - low) / max(high - low, 1e-12) * bins).astype(int), 0, bins - 1)
    time = np.bincount(which, h, bins)
    count = np.maximum(np.bincount(which, minlength=bins), 1)
    mean = np.bincount(which, torque, bins) / count
    scatter = np.sqrt(np.bincount(which, (torque - mean[which]) ** 2, bins) / count)
    at = np.bincount(which, z, bins) / count
    told = time >= LEAST_TIME_S
    return at[told], mean[told], (scatter / np.sqrt(np.maximum(time / WINDOW_S, 1.0)))[told]


def _read(z: np.ndarray, unit: str) -> np.ndarray:
    """As people read it."""
    return np.degrees(z) if unit.startswith("°") else np.asarray(z)
