"""What looks on while a flight goes on, and says when it must end: one small class each.

A watch is made for one flight and called in every control period (see
`heli3dof.experiment.control_loop.control_period`). It says *why* in words that go into the
recording; whatever it says ends the flight with a ramp to zero. None of them changes a command.

===========  =====================================================================================
`Jump`       a count changed by more than the rig can turn, or time ran backwards or stood still
`FrozenEncoder`
             an encoder's count stood still although its axis must have turned
`SilentEncoder`
             an encoder's count changed again and again before the landing, and not in it
`Saturated`  a motor was asked for more than the limit for too long
`Late`       too many periods of the last second came too late
`Lost`       samples, or commands, were lost in a row for too long
`Suspended`  the computer slept: then there is no ramp, the device is stopped at once
===========  =====================================================================================

The numbers are the profile's ``[limits]``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from heli3dof.experiment.control_loop.control_period import Watch
from heli3dof.experiment.safety_monitors.encoder_jump import Jump
from heli3dof.experiment.safety_monitors.frozen_encoder import FrozenEncoder
from heli3dof.experiment.safety_monitors.host_suspend import Suspended
from heli3dof.experiment.safety_monitors.lateness import Late, Lost
from heli3dof.experiment.safety_monitors.saturation import Saturated
from heli3dof.experiment.safety_monitors.silent_encoder import SilentEncoder
from heli3dof.rig.profile import Profile

__all__ = [
    "FrozenEncoder",
    "Jump",
    "Late",
    "Lost",
    "Saturated",
    "SilentEncoder",
    "Suspended",
    "Watches",
    "watches_for",
]


@dataclass(frozen=True)
class Watches:
    """The watches of one flight."""

    each_period: tuple[Watch, ...]
    at_once: Callable[[], str | None]
    """Why to stop without a ramp; asked in every period of the ramp"""
    must_still_fall: Callable[[], bool]
    """Whether the arm stands above the table without thrust: the ramp goes on at zero volts"""


def watches_for(profile: Profile) -> Watches:
    """All of them, fresh, for one flight with this profile."""
    suspended, frozen = Suspended(), FrozenEncoder(profile)
    return Watches(
        (suspended, Jump(profile), Lost(profile), Late(profile), frozen, SilentEncoder(profile),
         Saturated(profile)),
        suspended.at_once,
        frozen.must_still_fall,
    )  # fmt: skip
