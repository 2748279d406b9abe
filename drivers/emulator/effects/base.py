"""Defines how an effect is described: name, parameters with units and bounds, and its functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from heli3dof.axes import AXES

from ..body import Setup
from ..plant_effects import Kernel
from ..plant_layout import PARAMETER_SIZE, A, Stage

ALL_AXES = AXES
MOST_PARAMETERS = PARAMETER_SIZE - A
"""Largest number of an effect's parameters: the row of `plant_layout` also contains the axis"""


@dataclass(frozen=True)
class Parameter:
    """A number that an effect needs: its unit, meaning, default, and bounds ``low`` … ``high``."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str
    default: float | None = None
    """The value if the URL gives none; None: the URL must give one"""


@dataclass(frozen=True)
class Effect:
    """Physics that ``hide=`` adds to the ideal rig, e.g. friction.

    ``kernels`` maps a `Stage`, a point of the simulation, to the compiled function that the plant
    calls there. The function ``setup(setup, axis, values)`` returns the changed `Setup`; the
    emulator calls it once before the rig runs. Effects of the same stage act in ascending
    ``order``.
    """

    name: str
    summary: str
    parameters: tuple[Parameter, ...]
    example: str
    axes: tuple[str, ...] = ()
    kernels: Mapping[Stage, Kernel] = field(default_factory=dict)
    setup: Callable[[Setup, int, tuple[float, ...]], Setup] | None = None
    order: int = 0

    def __post_init__(self) -> None:
        if not isinstance(self.parameters, tuple):
            raise TypeError(f"{self.name}: parameters is not a tuple; a single one needs a comma")
        if len(self.parameters) > MOST_PARAMETERS:
            raise ValueError(f"{self.name}: more than {MOST_PARAMETERS} parameters")
        if wrong := [a for a in self.axes if a not in AXES]:
            raise ValueError(f"{self.name}: axes contains {wrong[0]!r}; axes are {', '.join(AXES)}")
        if not all(isinstance(stage, Stage) for stage in self.kernels):
            raise TypeError(
                f"{self.name}: the keys of kernels are not Stage.TORQUE or another Stage"
            )
        if not self.kernels and self.setup is None:
            raise ValueError(f"{self.name}: there is neither a kernel nor a setup, so no effect")


@dataclass(frozen=True)
class Hidden:
    """An effect selected by ``hide=``: its axis (0 roll, 1 pitch, 2 yaw; −1 none) and values."""

    effect: Effect
    axis: int
    values: tuple[float, ...]

    @property
    def text(self) -> str:
        """Return the effect in the notation of ``hide=``, e.g. ``friction.coulomb.yaw:0.03``."""
        name = self.effect.name + (f".{AXES[self.axis]}" if self.axis >= 0 else "")
        return name + ":" + "@".join(f"{v:g}" for v in self.values)
