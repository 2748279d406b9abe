"""Empirical torques: linear or piecewise linear functions of a product of measured quantities.

    τ = c · x y                      name ``empirical.x*y.AXIS``
    τ = Σ_k τ_k φ_k(x y)             name ``empirical.spline(x*y:low:high).AXIS``

x and y are quantities of `QUANTITIES`; y may be omitted. The constant c is in N·m per unit of the
product. τ_k (N·m) is the torque at knot k. The hat function φ_k falls linearly from 1 at knot k to
0 at its neighbours. `KNOTS` knots divide the range from low to high (SI units) evenly. Outside this
range τ is constant.

A diagnosis adds such a torque if no effect of the catalogue explains the data. The name defines the
equation. So a model file needs only the name and the value of c, or the values of all τ_k, to
describe the torque.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.parameter_units import torque_per
from heli3dof.model.physics.compiled_effects import Hook
from heli3dof.model.physics.state_layout import (
    AXIS,
    P_DOT,
    PSI,
    PSI_DOT,
    R_DOT,
    SIZE,
    V_BACK,
    V_FRONT,
    A,
    P,
    R,
    Stage,
)

PREFIX = "empirical."
KNOTS = 9
_SINE, _ABSOLUTE, _COSINE = SIZE, 2 * SIZE, 3 * SIZE
_SUM, _DIFFERENCE, _ONE = range(4 * SIZE, 4 * SIZE + 3)

QUANTITIES = {
    "roll": (R, "rad", 0.3), "pitch": (P, "rad", 0.3), "yaw": (PSI, "rad", 0.3),
    "sin(roll)": (_SINE + R, "", 0.3), "sin(pitch)": (_SINE + P, "", 0.3),
    "sin(yaw)": (_SINE + PSI, "", 0.3),
    "cos(roll)": (_COSINE + R, "", 1.0), "cos(pitch)": (_COSINE + P, "", 1.0),
    "cos(yaw)": (_COSINE + PSI, "", 1.0),
    "roll_rate": (R_DOT, "rad/s", 0.3), "pitch_rate": (P_DOT, "rad/s", 0.3),
    "yaw_rate": (PSI_DOT, "rad/s", 0.3),
    "abs(roll)": (_ABSOLUTE + R, "rad", 0.3), "abs(pitch)": (_ABSOLUTE + P, "rad", 0.3),
    "abs(yaw)": (_ABSOLUTE + PSI, "rad", 0.3),
    "abs(roll_rate)": (_ABSOLUTE + R_DOT, "rad/s", 0.3),
    "abs(pitch_rate)": (_ABSOLUTE + P_DOT, "rad/s", 0.3),
    "abs(yaw_rate)": (_ABSOLUTE + PSI_DOT, "rad/s", 0.3),
    "voltage_front": (V_FRONT, "V", 7.0), "voltage_back": (V_BACK, "V", 7.0),
    "voltage_sum": (_SUM, "V", 15.0), "voltage_difference": (_DIFFERENCE, "V", 2.0),
}  # fmt: skip
"""Quantity → (code, unit, usual size). A code below `SIZE` is an index of the context array; a
larger code also contains the function to apply (`_value`)."""
TYPICAL_NM = 0.01
"""N·m, torque with a noticeable effect on the rigs of the literature: `Parameter.typical`."""
LARGEST_NM = 10.0
"""N·m, largest magnitude of an estimated torque at the usual size of its quantities."""


def factors(product: str) -> list[str]:
    """Return the names of a product's quantities; [] if one is unknown or there are more than two.

    >>> factors("abs(yaw_rate)*yaw_rate"), factors("colour")
    (['abs(yaw_rate)', 'yaw_rate'], [])
    """
    names = product.split("*")
    return names if len(names) <= 2 and all(n in QUANTITIES for n in names) else []


def unit_of_product(product: str) -> str:
    """Return the unit of a product, such as ``rad/s·V``; empty for one without a unit.

    >>> unit_of_product("yaw_rate*voltage_sum"), unit_of_product("sin(yaw)")
    ('rad/s·V', '')
    """
    return "·".join(u for n in factors(product) if (u := QUANTITIES[n][1]))


@cache
def empirical_effect(name: str) -> Effect | None:
    """Return the `Effect` of a name such as ``empirical.sin(yaw)``; None for any other name."""
    if not name.startswith(PREFIX):
        return None
    what = name.removeprefix(PREFIX)
    spline = what.startswith("spline(") and what.endswith(")")
    try:
        product, low, high = what[7:-1].split(":") if spline else (what, "0", "1")
        ends = float(low), float(high)
    except ValueError:
        return None
    used = factors(product)
    if not used or not ends[0] < ends[1]:
        return None
    first, second = ([QUANTITIES[n][0] for n in used] + [_ONE])[:2]
    unit = unit_of_product(product)
    if spline:
        parameters = tuple(
            Parameter(f"torque_{k}_Nm", "N·m", 0.0, -LARGEST_NM, LARGEST_NM, TYPICAL_NM, f"τ_{k}")
            for k in range(KNOTS)
        )
        hook = _spline(first, second, *ends)
        summary = f"A torque that is a piecewise linear function of {product}."
    else:
        size = math.prod(QUANTITIES[n][2] for n in used)
        c = Parameter(
            "coefficient", torque_per(unit), 0.0, -LARGEST_NM / size,
            LARGEST_NM / size, TYPICAL_NM / size, "c",
        )  # fmt: skip
        parameters, hook = (c,), _product(first, second)
        summary = f"A torque c · {product}."
    return _Empirical(
        name, summary, parameters, {Stage.TORQUE: hook}, AXES, candidate=False, evidence="time"
    )


class _Empirical(Effect):
    """An effect that pickle stores as its name, because its hook is a closure."""

    def __reduce__(self) -> tuple[Callable[[str], Effect | None], tuple[str]]:
        return empirical_effect, (self.name,)


def _product(first: int, second: int) -> Hook:
    value = _value()

    def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
        out[int(par[AXIS])] += par[A] * value(s, first) * value(s, second)

    return torque


def _spline(first: int, second: int, low: float, high: float) -> Hook:
    value = _value()

    def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
        z = value(s, first) * value(s, second)
        at = min(max((z - low) / (high - low), 0.0), 1.0) * (KNOTS - 1)
        k = min(int(at), KNOTS - 2)
        out[int(par[AXIS])] += par[A + k] * (1.0 - (at - k)) + par[A + k + 1] * (at - k)

    return torque


@cache
def _value() -> Callable[[Any, int], float]:
    """Return the compiled function ``value(s, code)``: the value of the quantity with this code.

    `QUANTITIES` lists the codes; ``s`` is the simulation's context array.
    """
    from numba.extending import register_jitable

    def value(s: Any, code: int) -> float:
        if code == _ONE:
            return 1.0
        if code == _SUM:
            return float(s[V_FRONT] + s[V_BACK])
        if code == _DIFFERENCE:
            return float(s[V_FRONT] - s[V_BACK])
        if code >= _COSINE:
            return math.cos(s[code - _COSINE])
        if code >= _ABSOLUTE:
            return abs(float(s[code - _ABSOLUTE]))
        if code >= _SINE:
            return math.sin(s[code - _SINE])
        return float(s[code])

    return register_jitable(value)
