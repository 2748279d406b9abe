"""Check the functions of a plug-in's effect: a wrong index would end the process.

Each function runs in Python, at several states of the default rig, with the values of the effect's
example. Compiled code does not check an index, and cannot report an exception.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.plugins import CodeError, must_be, source_line
from heli3dof.rig.profile import default_profile

from . import plant_layout as at
from .body import Setup, setup_of
from .effect_spec import values_of
from .effects.base import Effect
from .plant_effects import Function, Kernel
from .plant_layout import Stage

STATES = 20
"""Number of states at which a function runs: the rig at rest, and random ones"""
LAST_S = 60.0
"""s, latest time of a state: the length of a usual flight (a convention)"""
SUBSTEP_S = 0.5e-3
"""s, a usual substep of the simulation (`plant.MAX_SUBSTEP_S`)"""
CHANGED = {Stage.VOLTAGE: slice(at.V_FRONT, at.V_BACK + 1),
           Stage.THRUST: slice(at.F_FRONT, at.F_BACK + 1),
           Stage.MEASURE: slice(at.R, at.R + 3),
           Stage.TORQUE: slice(at.R, at.R + 3), Stage.DRY_FRICTION: slice(at.R, at.R + 3),
           }  # fmt: skip
"""Stage → the elements of the context that ``out`` contains before the function changes it. For a
torque, to which the function adds, they are any three numbers."""


def check_effect(effect: Effect) -> None:
    """Raise CodeError at the first mistake in an effect's functions.

    A kernel must raise no exception, use no index outside its arrays, change only ``mem`` and
    ``out``, and give finite numbers. ``Effect.setup`` must return a `Setup`.
    """
    values = values_of(effect, effect.example.partition(":")[2], effect.example)
    level = setup_of(default_profile(), "level")
    for axis in [AXES.index(a) for a in effect.axes] or [-1]:
        if effect.setup is not None:
            with _named(f"{effect.name}, setup", effect.setup):
                must_be(Setup, effect.setup(level, axis, values))
        for stage, kernel in effect.kernels.items():
            must_be(Kernel, kernel)
            with _named(f"{effect.name}, {stage.name}", kernel.function):
                _run(stage, kernel.function, (axis, *values))
                assert kernel.address  # compiled


@contextmanager
def _named(what: str, function: Callable[..., Any]) -> Iterator[None]:
    """Raise every exception again as a CodeError with the name and the place of the function."""
    try:
        yield
    except Exception as error:  # the code is not ours
        text = f"{what}: {type(error).__name__}: {error}"
        raise CodeError(text, source_line(function)) from error


def _run(stage: Stage, function: Function, given: tuple[float, ...]) -> None:
    """Run a kernel's function at `STATES` states; ``given``: its axis, then its parameters."""
    profile = default_profile()
    rng = np.random.default_rng(0)
    motor, rates = profile.motor, np.radians(profile.limits.rates_deg_per_s)
    body = setup_of(profile, "level").vector(profile.encoder.rad_per_count)
    par, mem = np.zeros(at.PARAMETER_SIZE), np.zeros(at.MEMORY_SIZE)
    par[: len(given)] = given
    for i in range(STATES):
        s = np.zeros(at.CONTEXT_SIZE)
        s[at.H], s[at.V_START] = SUBSTEP_S, motor.V_o
        volts = np.full(2, motor.V_o)
        if i > 0:  # the first state is the rig at rest
            s[at.T] = rng.uniform(0, LAST_S)
            s[at.R : at.R + 3] = rng.uniform(*np.radians(profile.limits.ranges_deg).T)
            s[at.R_DOT : at.R_DOT + 3] = rng.uniform(-rates, rates)
            volts = rng.uniform(-motor.v_max, motor.v_max, 2)
        s[at.V_FRONT : at.V_BACK + 1], s[at.F_FRONT : at.F_BACK + 1] = volts, motor.K_f * volts
        out = body.copy() if stage is Stage.BODY else s[CHANGED[stage]].copy()
        for array in (s, body, par):
            array.flags.writeable = False
        with np.errstate(all="ignore"):
            function(s, body, par, mem, out)
        if not np.isfinite(out[np.isfinite(body)] if stage is Stage.BODY else out).all():
            raise ValueError("the result is not finite")
