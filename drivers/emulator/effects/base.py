"""The description of an effect: name, parameters with units and bounds, and where it acts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ..body import Setup
from ..plant_effects import Kernel
from ..plant_layout import Stage

ALL_AXES = ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class Parameter:
    """One number of an effect; values outside ``low`` … ``high`` are refused."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str
    default: float | None = None
    """The value where none is given; None: it must be given"""


@dataclass(frozen=True)
class Effect:
    """Behaviour of a rig that the base simulation does not have.

    ``kernels`` act while the rig runs, ``setup`` once before. Effects of one stage act in ascending
    ``order``, the order of the signal's path.
    """

    name: str
    summary: str
    parameters: tuple[Parameter, ...]
    example: str
    axes: tuple[str, ...] = ()
    kernels: Mapping[Stage, Kernel] = field(default_factory=dict)
    setup: Callable[[Setup, int, tuple[float, ...]], Setup] | None = None
    order: int = 0


@dataclass(frozen=True)
class Hidden:
    """A hidden effect with its axis (−1: none) and values."""

    effect: Effect
    axis: int
    values: tuple[float, ...]

    @property
    def text(self) -> str:
        """The text of ``hide=`` for it."""
        from heli3dof.axes import AXES

        name = self.effect.name + (f".{AXES[self.axis]}" if self.axis >= 0 else "")
        return name + ":" + "@".join(f"{v:g}" for v in self.values)
