"""`Structure`: the parameters of a rig with its effects, and their arrays for compiled functions.

The rigid body has four parameters:

=========  ======  ==================================
T_g        N·m     gravity torque of the level arm
J_roll     kg·m²   inertias of the level rig
J_pitch    kg·m²
J_yaw      kg·m²
=========  ======  ==================================

Their nominal values come from the rig's profile. The nominal T_g is 2 L_a K_f V_o, with the
distance L_a (m) from yaw axis to body, the thrust per volt K_f (N/V) and the hover voltage V_o (V)
of each motor. The nominal inertias are those in the profile's section [inertia]. An inertia that is
missing there is computed from the profile's masses.

Flights do not determine K_f, so all estimates assume that the profile's K_f is correct. If the true
K_f is 1.1 times as large, so are the true parameters (`physics.rigid_body`).

An effect's parameter is named ``<effect>[.<axis>].<parameter>``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.model.effects import Term
from heli3dof.model.effects.base import Parameter
from heli3dof.model.physics import state_layout as _s
from heli3dof.model.physics.compiled_effects import Hook, address
from heli3dof.rig.profile import Profile

INERTIA_PRIOR = 0.7
"""Prior standard deviation of ln(J/nominal) of an inertia J: a factor of two up or down."""


@dataclass(frozen=True)
class FreeParameter(Parameter):
    """A parameter to estimate, of the rigid body or of an effect."""

    term: str | None = None
    """The name of its term (effect on an axis); None for a parameter of the rigid body."""

    def scaled(self, value: float) -> float:
        """Return θ, the scaled parameter of a fit: value/``typical``, or ln(value) if ``log``."""
        return math.log(value) if self.log else value / self.typical

    def unscaled(self, theta: float) -> float:
        """Return the value of the scaled parameter ``theta``; the inverse of `scaled`."""
        return math.exp(theta) if self.log else theta * self.typical

    def slope(self, value: float) -> float:
        """Return the derivative of the value with respect to the scaled parameter, at ``value``."""
        return value if self.log else self.typical


def first_parameters(free: Sequence[FreeParameter]) -> dict[str, int]:
    """Return a dict: name of a term (effect on an axis) → index of its first entry in ``free``."""
    return {f.term: j for j, f in reversed(list(enumerate(free))) if f.term is not None}


@dataclass(frozen=True)
class Hooks:
    """The H compiled functions of the effects, sorted by `Stage`, and their machine addresses."""

    first: np.ndarray
    """(7,) int64, indices: functions first[stage] … first[stage + 1] − 1 belong to ``stage``."""
    functions: tuple[Hook, ...]
    owner: tuple[int, ...]
    """The index of each function's term in `Structure.terms`."""

    @cached_property
    def address(self) -> np.ndarray:
        """Return the machine addresses (H + 1,) int64 of the H `functions`.

        The last element is 0 and belongs to no function.
        """
        return np.array([*map(address, self.functions), 0], dtype=np.int64)


@dataclass(frozen=True)
class Structure:
    """A model structure: a rig's profile and effects, which define the n parameters to estimate."""

    profile: Profile
    terms: tuple[Term, ...]

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields to pickle, without `hooks`: addresses hold in one process only."""
        return {k: v for k, v in self.__dict__.items() if k != "hooks"}

    @cached_property
    def free(self) -> tuple[FreeParameter, ...]:
        """Return the n parameters to estimate: four of the rigid body, then effect parameters."""
        p = self.profile
        T_g = p.trim_torque
        size = max(abs(T_g), 0.1)
        body = [FreeParameter("T_g", "N·m", T_g, -10 * size, 10 * size, size, "", prior_std=size)]
        body += [
            FreeParameter(f"J_{axis}", "kg·m²", J, J / 8, J * 8, J, "", True, INERTIA_PRIOR)
            for axis, J in zip(AXES, p.inertias, strict=True)
        ]
        effects = (
            FreeParameter(**{**vars(q), "name": f"{t.name}.{q.name}"}, term=t.name)
            for t in self.terms
            for q in t.effect.parameters
        )
        return (*body, *effects)

    @cached_property
    def names(self) -> tuple[str, ...]:
        return tuple(f.name for f in self.free)

    def with_terms(self, *terms: Term) -> Structure:
        """Return the structure with further effects; in `free`, their parameters are last."""
        return Structure(self.profile, (*self.terms, *terms))

    @property
    def formal(self) -> tuple[Term, ...]:
        """Return the effects that select simplified equations of the rigid body (`Effect.formal`).

        They describe a choice of equations, not a defect of the rig.
        """
        return tuple(t for t in self.terms if t.effect.formal)

    @property
    def start(self) -> np.ndarray:
        return np.array([f.start for f in self.free])

    def scaled(self, values: Iterable[float]) -> np.ndarray:
        """Return the scaled parameters θ (n,) for ``values`` (n,) in the parameters' units."""
        return np.array([f.scaled(v) for f, v in zip(self.free, values, strict=True)])

    def unscaled(self, theta: Iterable[float]) -> np.ndarray:
        """Return the values (n,) of the scaled parameters ``theta``; the inverse of `scaled`."""
        return np.array([f.unscaled(c) for f, c in zip(self.free, theta, strict=True)])

    @cached_property
    def hooks(self) -> Hooks:
        """Return the compiled functions of all effects, in calling order."""
        calls = [
            (stage, t.effect.order, i)
            for stage in _s.Stage
            for i, t in enumerate(self.terms)
            if stage in t.effect.hooks
        ]
        calls.sort()
        count = [sum(1 for c in calls if c[0] is stage) for stage in _s.Stage]
        return Hooks(
            np.concatenate([[0], np.cumsum(count)]).astype(np.int64),
            tuple(self.terms[i].effect.hooks[stage] for stage, _, i in calls),
            tuple(i for _, _, i in calls),
        )

    def arguments(self, values: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the arguments (s, first, address, par, mem) of the compiled functions.

        ``values`` (n,) are the parameters, in the units of `free`. The arguments are:

        - s (SIZE,): parameters and state of the rig (`state_layout`);
        - first, address: the attributes of `Hooks` with these names, which locate the H compiled
          functions of the effects;
        - par (H + 1, PARAMETERS): row i contains the parameters of function i;
        - mem (H + 1, MEMORY): row i is the memory of function i, initially zero.

        The last rows of par and mem belong to no function; that of mem is work space. For J sets of
        parameters, ``values`` (J, n), the arrays s and par have a further first dimension of
        length J.
        """
        sets = [self._s_and_par(v) for v in np.atleast_2d(values)]
        s, par = np.array([s for s, _ in sets]), np.array([par for _, par in sets])
        if np.ndim(values) == 1:
            s, par = s[0], par[0]
        mem = np.zeros((len(self.hooks.owner) + 1, _s.MEMORY))
        return s, self.hooks.first, self.hooks.address, par, mem

    def _s_and_par(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the arrays s and par of `arguments`, for one set of parameter ``values`` (n,).

        s (SIZE,) contains the rig's parameters and state. par (H + 1, PARAMETERS) is for the H
        compiled functions of the effects. Row i of par contains the effect parameters that function
        i reads. The last row is zero.
        """
        s = _s.context(self.profile)
        s[_s.T_G] = values[0]
        s[_s.J_R : _s.J_R + 3] = values[1:4]
        unit = thrust_per_volt_ratio(self.profile, values)
        s[_s.BODY_P] *= unit
        s[_s.BODY_PSI] *= unit
        rows = np.zeros((len(self.terms), _s.PARAMETERS))
        at = 4
        for i, t in enumerate(self.terms):
            n = len(t.effect.parameters)
            rows[i, _s.AXIS] = t.axis_index
            rows[i, _s.A : _s.A + n] = values[at : at + n]
            at += n
        owner = self.hooks.owner
        par = np.zeros((len(owner) + 1, _s.PARAMETERS))
        for h, i in enumerate(owner):
            par[h] = rows[i]
        return s, par

    def values_of(self, given: Mapping[str, float]) -> np.ndarray:
        """Return all values (n,): those in ``given`` (name → value), else starting values."""
        return np.array([given.get(f.name, f.start) for f in self.free])


def thrust_per_volt_ratio(profile: Profile, values: Sequence[float] | np.ndarray) -> float:
    """Return an estimate of the ratio of the profile's thrust per volt K_f to the true K_f.

    ``values`` start with the gravity torque T_g and the three inertias, estimated with the
    profile's K_f. A wrong K_f multiplies all four by this ratio. The result is the median of their
    ratios to the nominal values, so a deviation of only one of the four has little influence.
    Ratios that are not positive are left out.
    """
    nominal = (profile.trim_torque, *profile.inertias)
    ratio = sorted(v / n for v, n in zip(values[:4], nominal, strict=True) if n and v / n > 0)
    if not ratio:
        return 1.0
    middle = (len(ratio) - 1) // 2
    return float((ratio[middle] + ratio[len(ratio) // 2]) / 2)
