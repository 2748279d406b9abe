"""Faults of the emulated rig, to test safety functions: ``fault=KIND[.AXIS]@SECONDS[:COUNTS]``.

`KINDS` describes each kind. Several faults are separated by commas, or ``fault=`` is repeated.
``AXIS`` is roll, pitch or yaw, or the motor: front or back. The seconds are on the device's clock,
which is 0 when the simulation of the motion starts. ``COUNTS`` is the step of an encoder's count
(kind ``jump``). A fault of the amplifier occurs once: arming clears it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from heli3dof.axes import ALIASES, AXES, MOTORS
from heli3dof.errors import UsageError, did_you_mean
from heli3dof.rig.interface import Flags

from ..link.frames import Cause

if TYPE_CHECKING:
    from .plant import Plant, Truth

TRIPS = {
    "overcurrent": (Flags.FAULT, Cause.OVERCURRENT),
    "overtemperature": (Flags.FAULT, Cause.OVERTEMPERATURE),
    "stall": (Flags.STALL, Cause.STALL),
    "button": (Flags.ESTOP, Cause.BUTTON),
}
"""Fault at which the amplifier stops → flag and cause in its samples from then on"""
KINDS = {
    "overcurrent": ("overcurrent@3", "The amplifier stops: zero volts, flag `FAULT`."),
    "overtemperature": ("overtemperature@3", "As `overcurrent`, with the cause overtemperature."),
    "stall": ("stall@3", "A motor draws current and does not turn: zero volts, flag `STALL`."),
    "button": ("button@3", "The rig's button is pressed: zero volts, flag `ESTOP`."),
    "frozen": ("frozen.yaw@3", "An encoder's count no longer changes."),
    "jump": ("jump.pitch@3:200", "A count is 200 higher from then on, without any motion."),
    "reversed": ("reversed.yaw@0", "An encoder counts the wrong way from then on."),
    "swapped": ("swapped@0", "The leads of the two motors are swapped."),
    "dead": ("dead.front@3", "A motor (`front`, `back`) no longer turns."),
    "inverted": ("inverted.back@0", "A motor turns the wrong way: its two wires are swapped."),
}
"""Kind → example and effect: the table in docs/reference/mock.md"""
ON_MOTORS = ("dead", "inverted")
"""Kinds that name a motor instead of an axis"""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of the emulated rig: kind, axis or motor, and start ``at_s`` (device's clock, s)."""

    kind: str
    at_s: float
    axis: int = -1
    """Index of the axis, or of the motor for a kind in `ON_MOTORS`; −1: none"""
    counts: int = 0
    """Counts that a ``jump`` adds"""


def parse_faults(texts: Iterable[str]) -> tuple[Fault, ...]:
    """Return the faults in ``texts``, values of the URL option ``fault=``, the earliest first.

    Raises UsageError for an unknown kind or axis (naming the nearest) and for a bad number.
    """
    parts = [p.strip() for text in texts for p in text.split(",")]
    return tuple(sorted((_parse(p) for p in parts if p), key=lambda fault: fault.at_s))


def _parse(text: str) -> Fault:
    name, at, rest = text.partition("@")
    kind, _, axis = name.partition(".")
    if kind not in KINDS:
        raise UsageError(
            f"fault={text}: there is no fault {kind!r}.",
            cause=f"a typing error; {did_you_mean(kind, KINDS)}",
            fix="fault=overcurrent@3; docs/reference/mock.md lists them",
        )
    example, _ = KINDS[kind]
    seconds, _, counts = rest.partition(":")
    at_s, jump = _number(seconds), _number(counts)
    if not at or not 0 <= at_s <= 1e6:
        raise _unclear(text, f"{seconds!r} is not a time in s between 0 and 10⁶", example)
    if kind in TRIPS or kind == "swapped":
        if axis or counts:
            raise _unclear(text, f"{kind} takes a time only", example)
        return Fault(kind, at_s)
    named = MOTORS if kind in ON_MOTORS else AXES
    axis = ALIASES.get(axis, axis)
    if axis not in named:
        target = "a motor" if kind in ON_MOTORS else "an axis"
        raise _unclear(text, f"{axis!r} is not {target}; {did_you_mean(axis, named)}", example)
    if kind != "jump":
        if counts:
            raise _unclear(text, f"{kind} takes no counts", example)
        return Fault(kind, at_s, named.index(axis))
    if not (jump and jump == int(jump) and abs(jump) <= 1e6):
        raise _unclear(text, f"{counts!r} is not a whole number of counts other than 0", example)
    return Fault(kind, at_s, AXES.index(axis), int(jump))


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        return math.inf if text else 0.0
    return value if math.isfinite(value) else math.inf


def _unclear(text: str, problem: str, example: str) -> UsageError:
    return UsageError(
        f"fault={text}: {problem}.", cause="a typing error or another unit.", fix=f"fault={example}"
    )


class FaultyPlant:
    """A `Plant` with faults of encoders, motors and amplifier, used in place of a `Plant`."""

    def __init__(self, plant: Plant, faults: tuple[Fault, ...]) -> None:
        self._plant = plant
        self._faults = faults
        self._stuck: dict[int, int] = {}
        self._reversed: dict[int, int] = {}
        """Axis → the count at which its encoder reversed"""
        self.dt = plant.dt
        self.trips = [f for f in faults if f.kind in TRIPS]
        """Faults of the amplifier (`TRIPS`) that have not occurred yet"""

    def step(self, v_front: float, v_back: float) -> bool:
        """Simulate one control period at these voltages (V), with faults; see `Plant.step`."""
        before = self.counts
        arrived = self._plant.step(*self._at_the_motors(v_front, v_back))
        for fault in self._faults:
            if fault.kind == "frozen" and fault.at_s <= self._plant.t:
                self._stuck.setdefault(fault.axis, before[fault.axis])
            elif fault.kind == "reversed" and fault.at_s <= self._plant.t:
                self._reversed.setdefault(fault.axis, before[fault.axis])
        return arrived

    def _at_the_motors(self, v_front: float, v_back: float) -> tuple[float, float]:
        volts = [v_front, v_back]
        for fault in self._faults:
            if fault.at_s <= self._plant.t:
                if fault.kind == "swapped":
                    volts.reverse()
                elif fault.kind in ON_MOTORS:
                    volts[fault.axis] *= 0.0 if fault.kind == "dead" else -1.0
        return volts[0], volts[1]

    def trip(self) -> tuple[Flags, Cause] | None:
        """Return the state flag and the cause of an amplifier fault that begins now, else None.

        Each fault is returned only once.
        """
        if not self.trips or self.trips[0].at_s > self._plant.t:
            return None
        return TRIPS[self.trips.pop(0).kind]

    @property
    def counts(self) -> tuple[int, int, int]:
        counts = list(self._plant.counts)
        for fault in self._faults:
            if fault.kind == "jump" and fault.at_s <= self._plant.t:
                counts[fault.axis] += fault.counts
        for axis, at in self._reversed.items():
            counts[axis] = 2 * at - counts[axis]
        for axis, stuck in self._stuck.items():
            counts[axis] = stuck
        return counts[0], counts[1], counts[2]

    @property
    def t(self) -> float:
        return self._plant.t

    @property
    def periods(self) -> int:
        return self._plant.periods

    @property
    def truth(self) -> Truth:
        return self._plant.truth
