"""Control periods of level hover, with changed fields; safety monitors made of functions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.safety_monitors import SafetyMonitor
from heli3dof.rig.interface import Flags, Sample
from heli3dof.rig.profile import default_profile

PROFILE = default_profile()
DT = PROFILE.dt
HOVER = PROFILE.motor.V_o
LEVEL = 313
"""counts from the table to level roll"""


def period(k: int, *, counts: tuple[int, int, int] = (LEVEL, 0, 0), **changed: Any) -> Period:
    """Period k of level hover; ``changed``: fields of the period or of its sample."""
    v = changed.pop("v_applied", (HOVER, HOVER))
    sample = Sample(k, k * DT, counts, v, (0.0, 0.0), Flags.ENABLED, k * DT)
    of_sample = {n: changed.pop(n) for n in list(changed) if n in Sample.__slots__}
    rest, q = PROFILE.encoder.rest_rad, PROFILE.encoder.rad_per_count
    angle = tuple(float(rest[i] + counts[i] * q[i]) for i in range(3))
    now = Period(
        k, k * DT, replace(sample, **of_sample), angle, (0.0, 0.0, 0.0), v, v, v, k, 0.0, 0
    )  # type: ignore[arg-type]
    return now._replace(**changed)


class Judging(SafetyMonitor):
    """A safety monitor that judges by a function of the period."""

    def __init__(self, judge: Callable[[Period], object]) -> None:
        self._judge = judge

    def __call__(self, now: Period) -> Any:
        return self._judge(now)
