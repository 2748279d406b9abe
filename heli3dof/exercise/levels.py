"""Draw the hidden effects of an exercise at random, by its level of difficulty (`LEVELS`).

The table `_SIZES` gives a medium and a large size of each effect, for the emulated rig with the
default profile. A medium effect is noticeable, a large one spoils a demonstration; with either, a
flight stays inside the safety envelope. The drawn size is up to 15 % weaker than the size in the
table, so that the table does not reveal it.

Not in the table are:

- effects that no flight can identify (`encoder.offset`, `encoder.scale`)
- effects that depend on the flown plan (`mass.change`, `motor.saturation`)
- effects that the time stamps reveal (`timing`)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.model.effects import term

LEVELS = {
    1: "one large effect",
    2: "one medium effect",
    3: "two effects, medium or large",
    4: "two such effects on a rig whose K_f, gravity torque and inertias differ from the profile",
    5: "a rig as in 4 with two effects, one, none, or one outside the catalogue",
}
SPREAD = 0.07
"""Largest relative difference of the rig's parameters from the profile, at levels 4 and 5. Two
such differences add up to less than the profile's tolerance of 15 %. A difference above this
tolerance would be a cause."""
NEARER = 0.15
"""Largest relative decrease of a drawn size from `_SIZES` towards "no effect" (0; 1 for a ratio)"""
SIGN, RATIO, ONE_WAY = "either sign", "or its inverse", "one sign"
UNMODELLED = "unmodelled"
"""What an answer calls an effect outside the catalogue, with the axis: ``unmodelled.yaw``"""

_SIZES: dict[str, tuple[float, float, str]] = {
    "friction.coulomb.roll": (0.04, 0.1, ONE_WAY),
    "friction.coulomb.pitch": (0.005, 0.012, ONE_WAY),
    "friction.coulomb.yaw": (0.02, 0.05, ONE_WAY),
    "friction.viscous.roll": (0.1, 0.25, ONE_WAY),
    "friction.viscous.pitch": (0.02, 0.05, ONE_WAY),
    "friction.viscous.yaw": (0.08, 0.2, ONE_WAY),
    "drag.quadratic.roll": (0.4, 1.0, ONE_WAY),
    "drag.quadratic.pitch": (0.06, 0.15, ONE_WAY),
    "drag.quadratic.yaw": (0.2, 0.6, ONE_WAY),
    "stiffness.pendulum.roll": (0.4, 1.0, ONE_WAY),
    "stiffness.pendulum.pitch": (0.01, 0.03, ONE_WAY),
    "stiffness.cable.yaw": (0.05, 0.15, ONE_WAY),
    "bias.torque.pitch": (0.008, 0.025, SIGN),
    "bias.torque.yaw": (0.015, 0.05, SIGN),
    "mass.imbalance": (0.45, 0.55, SIGN),
    "inertia.roll": (1.55, 1.7, RATIO),
    "inertia.pitch": (1.55, 1.7, RATIO),
    "inertia.yaw": (1.55, 1.7, RATIO),
    "motor.lag": (0.03, 0.08, ONE_WAY),
    "motor.delay": (0.015, 0.03, ONE_WAY),
    "motor.dead_zone": (1.0, 2.0, ONE_WAY),
    "motor.thrust_curve": (0.3, 0.7, ONE_WAY),
    "motor.thrust_gain": (1.55, 1.7, RATIO),
    "motor.thrust_mismatch": (1.04, 1.12, RATIO),
    "motor.supply_sag": (0.004, 0.01, ONE_WAY),
    "aero.ground_effect": (0.2, 0.4, ONE_WAY),
    "aero.reaction_torque": (0.012, 0.04, SIGN),
    "aero.inflow": (0.25, 0.6, ONE_WAY),
    "aero.gyroscopic": (0.002, 0.005, SIGN),
    "encoder.backlash.roll": (0.5, 1.0, ONE_WAY),
    "encoder.backlash.pitch": (0.5, 1.0, ONE_WAY),
    "encoder.backlash.yaw": (0.5, 1.0, ONE_WAY),
    "disturbance.periodic.roll": (0.05, 0.12, ONE_WAY),
    "disturbance.periodic.pitch": (0.005, 0.012, ONE_WAY),
    "disturbance.periodic.yaw": (0.02, 0.05, ONE_WAY),
}
_OUTSIDE: dict[str, tuple[str, float, float]] = {
    "other.yaw_torque_from_pitch_rate": ("damping_Nms_per_rad", 0.12, 0.3),
    "other.roll_torque_from_yaw_angle": ("torque_Nm", 0.15, 0.35),
    "other.pitch_torque_from_voltage_product": ("torque_Nm_per_V2", 0.0003, 0.0006),
    "other.yaw_torque_from_roll_rate_squared": ("drag_Nms2_per_rad2", 0.8, 2.0),
}
"""Effects of the emulator that ``diagnose`` has no model of: parameter, medium and large size"""
_SECOND = {"disturbance.periodic": (0.2, 3.0), "aero.ground_effect": (0.07, 0.15)}
"""Effect → range of its second value, drawn log-uniformly: the frequency in Hz, the height in m"""
_CALIBRATION = {"mass.imbalance", "inertia.roll", "inertia.pitch", "inertia.yaw"}
"""Effects that are not hidden at levels 4 and 5, where the spread changes the same numbers"""
_ALONE = "motor.thrust_gain"
"""Effect that is hidden only in levels 1 and 2, without a second one, as it scales every torque"""


@dataclass(frozen=True)
class Cause:
    """A hidden effect of the emulated rig."""

    name: str
    """Name of the effect with its axis, such as ``friction.coulomb.yaw``"""
    values: Mapping[str, float]
    """{parameter, such as ``torque_Nm``: its value}"""

    @property
    def text(self) -> str:
        """Return the effect in the notation of the emulated rig's URL option ``hide=``."""
        return f"{self.name}:{'@'.join(f'{v:.9g}' for v in self.values.values())}"


def draw(level: int, rng: np.random.Generator) -> tuple[list[Cause], float]:
    """Return random hidden effects for a difficulty ``level``, and the rig's spread.

    The spread is the largest relative difference of the rig's parameters from the profile: 0 or
    `SPREAD`.
    """
    if level <= 2:
        name = str(rng.choice(list(_SIZES)))
        return [_cause(name, 2 - level, rng)], 0.0
    if level == 5:
        kind = str(rng.choice(["two", "one", "none", "outside"]))
        if kind == "none":
            return [], SPREAD
        if kind == "outside":
            return [_outside(str(rng.choice(list(_OUTSIDE))), rng)], SPREAD
        count = 1 if kind == "one" else 2
    else:
        count = 2
    excluded = {_ALONE} if level == 3 else {_ALONE, *_CALIBRATION}
    names = rng.choice([n for n in _SIZES if n not in excluded], count, replace=False)
    causes = [_cause(str(n), int(rng.integers(2)), rng) for n in names]
    return causes, 0.0 if level == 3 else SPREAD


def _cause(name: str, size: int, rng: np.random.Generator) -> Cause:
    """Return the effect ``name`` with a value near its medium (``size`` 0) or large (1) size."""
    effect = term(name).effect
    medium, large, way = _SIZES[name]
    null = 1.0 if way == RATIO else 0.0
    value = null + ((medium, large)[size] - null) * (1 - NEARER * rng.random())
    if rng.random() < 0.5:
        value = {SIGN: -value, RATIO: 1 / value, ONE_WAY: value}[way]
    values = [value]
    if (second := _SECOND.get(effect.name)) is not None:
        values.append(float(np.exp(rng.uniform(*np.log(second)))))
    names = [p.name for p in effect.parameters]
    return Cause(name, {n: _rounded(v) for n, v in zip(names, values, strict=False)})


def _outside(name: str, rng: np.random.Generator) -> Cause:
    parameter, medium, large = _OUTSIDE[name]
    value = (medium, large)[int(rng.integers(2))] * (1 - NEARER * rng.random())
    return Cause(name, {parameter: _rounded(value if rng.random() < 0.5 else -value)})


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


_EQUAL = {
    "stiffness.pendulum.roll": "encoder.offset.roll",
    "aero.reaction_torque": "encoder.offset.pitch",
}
"""Hidden effect → another right answer: an effect that moves the rig in the same way"""


def right_names(cause: str) -> set[str]:
    """Return the names that are right answers for the hidden effect ``cause``.

    They are its own name, and that of an effect that moves the rig in the same way, if there is
    one. For an effect outside the catalogue, the right answer is ``unmodelled.<axis>``.
    """
    if cause.startswith("other."):
        axis = next(a for a in AXES if cause.startswith(f"other.{a}_"))
        return {f"{UNMODELLED}.{axis}"}
    return {cause, _EQUAL.get(cause, cause)}
