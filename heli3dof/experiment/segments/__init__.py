"""The kinds of segment of a plan: one file each, with a class named ``Segment``.

A segment is a table of the plan's TOML file, with a duration. A segment renders, for each of its
control periods, the references (rad) and the voltages (V) to add to the controller's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, Field

from heli3dof.axes import AXES
from heli3dof.model.control.controller import LEARN, OPEN
from heli3dof.plugins import modules_of
from heli3dof.toml_file import Finite, Key, Positive, Section


@dataclass(frozen=True)
class Clock:
    """Number ``n`` and length ``dt`` (s) of a segment's control periods, and a random generator."""

    n: int
    dt: float
    rng: np.random.Generator

    @property
    def t(self) -> np.ndarray:
        """Return the times (n,) of the segment's control periods, in s since its start."""
        return np.arange(self.n) * self.dt


class BaseSegment(Section):
    """Keys of every segment: a duration, and the references that change, in degrees.

    A reference that is not given keeps its value (zero at the start).
    """

    kind: Annotated[str, Key("which segment it is")]
    duration_s: Annotated[Positive, Key("how long it lasts", "s")]
    roll_deg: Annotated[Finite | None, Key("roll reference; if absent, unchanged", "°")] = None
    pitch_deg: Annotated[Finite | None, Key("pitch reference; if absent, unchanged", "°")] = None
    yaw_deg: Annotated[Finite | None, Key("yaw reference; if absent, unchanged", "°")] = None

    def target(self, before: np.ndarray) -> np.ndarray:
        """Return the references (3,) in rad that this segment sets.

        ``before``: references (3,) in rad at the end of the previous segment.
        """
        given = (self.roll_deg, self.pitch_deg, self.yaw_deg)
        return np.array(
            [b if g is None else np.radians(g) for g, b in zip(given, before, strict=True)]
        )

    def render(self, clock: Clock, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return references (n, 3) in rad, and voltages (n, 2) in V to add to the controller's.

        ``before``: references (3,) in rad at the end of the previous segment. By default the
        references jump to their new values, and no voltage is added.
        """
        return np.tile(self.target(before), (clock.n, 1)), np.zeros((clock.n, 2))

    def opened(self, clock: Clock) -> np.ndarray:
        """Return the mode (n, 3) of each axis's control loop in each of n control periods.

        ``clock``: the segment's control periods. By default all loops are closed. The modes are:

        - 0, closed
        - 1, closed, while the mean of the controller's voltages for the axis is measured
        - 2, open: these mean voltages replace the controller's voltages for the axis
        """
        return np.zeros((clock.n, 3), dtype=np.int8)

    def summary(self) -> str:
        """Return a line of text that describes the segment, for ``heli3dof run --dry-run``."""
        moves = [
            f"{axis} {value:g}°"
            for axis, value in zip(AXES, (self.roll_deg, self.pitch_deg, self.yaw_deg), strict=True)
            if value is not None
        ]
        head = f"{self.kind} {self.duration_s:g} s" + (f" to {', '.join(moves)}" if moves else "")
        return ", ".join(filter(None, (head, self.details())))

    def details(self) -> str:
        """Return the last part of `summary`: values of the keys that only this segment kind has."""
        own = {k: v for k, v in self if k not in BaseSegment.model_fields and v is not None}
        return ", ".join(f"{key} {_printed(value)}" for key, value in own.items())


def _printed(value: Any) -> str:
    if isinstance(value, tuple):
        return " to ".join(map(_printed, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def _rising(band: tuple[float, float]) -> tuple[float, float]:
    if not 0 < band[0] < band[1]:
        raise ValueError("band_Hz is two rising frequencies")
    return band


Band = Annotated[
    tuple[Finite, Finite], AfterValidator(_rising), Key("lowest and highest frequency", "Hz")
]
"""A frequency band in Hz"""


class FreeSegment(BaseSegment):
    """A segment that opens the control loop of one axis.

    First the closed loop holds the axis for ``learn_s`` seconds, in which the mean of the
    controller's voltages for this axis is measured. Then the closed loop brings the axis to the
    initial state of its free motion. Then the loop opens: the mean voltages replace the
    controller's voltages for this axis.
    """

    axis: ClassVar[int]
    """The axis whose loop opens: 0 roll, 1 pitch, 2 yaw"""
    learn_s: Annotated[
        Finite,
        Field(ge=0),
        Key("hover time whose mean voltage is stored; 0: use the last stored voltage", "s"),
    ] = 4.0

    @property
    def approach_s(self) -> float:
        """Return how long the second of the segment's three phases takes, in s.

        - Learn (`learn_s` seconds): the closed loop holds the axis. The controller measures the
          mean of its voltages for this axis.
        - Approach (this time): the closed loop brings the axis to the initial state of the free
          motion.
        - Free motion (`free_s` seconds): the loop of this axis is open.
        """
        raise NotImplementedError

    @property
    def free_s(self) -> float:
        """Return for how long the loop is open, in s."""
        return max(0.0, self.duration_s - self.learn_s - self.approach_s)

    def opened(self, clock: Clock) -> np.ndarray:
        mode = super().opened(clock)
        mode[clock.t < self.learn_s, self.axis] = LEARN
        mode[clock.t >= self.learn_s + self.approach_s, self.axis] = OPEN
        return mode


@cache
def kinds() -> dict[str, type[BaseSegment]]:
    """Return the class of every kind of segment in this package, by its name in TOML."""
    classes = [module.Segment for module in modules_of(__name__)]
    return {each.model_fields["kind"].default: each for each in classes}
