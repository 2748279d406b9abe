"""What an effect is: a name, its parameters, and small functions that act in a stage of the rig.

An effect is one file in this folder (or an object registered under the entry-point group
``heli3dof.effects``) with ``EFFECT = Effect(...)``. Its docstring holds the equation. Nothing
else has to know of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from heli3dof.axes import AXES
from heli3dof.model.physics.compiled_effects import Hook
from heli3dof.model.physics.state_layout import Stage

ABSCISSAE = (
    "roll", "pitch", "yaw", "roll_rate", "pitch_rate", "yaw_rate", "voltage_sum",
    "voltage_difference", "voltage_front", "voltage_back", "time",
)  # fmt: skip
"""What the evidence for an effect may be drawn against; ``{axis}`` in one stands for the term's."""


@dataclass(frozen=True)
class Parameter:
    """One number of an effect, in ``unit``.

    Attributes:
        null: the value at which the effect is absent.
        low, high: what is physically possible; estimates stay inside. Friction may come out
            slightly negative where there is none: an interval that is cut off at zero is wrong.
        typical: a size that matters on a rig: starts, steps and weak priors follow from it.
        log: estimated as its logarithm (for what is positive and never absent).
        prior_std: standard deviation of the weak prior about ``start``, in ``unit`` (of the
            logarithm where ``log``).
        start: where a fit starts; None is ``null`` (``typical`` where ``log``).
    """

    name: str
    unit: str
    null: float
    low: float
    high: float
    typical: float
    meaning: str
    log: bool = False
    prior_std: float | None = None
    start: float | None = None

    @property
    def started(self) -> float:
        if self.start is not None:
            return self.start
        return self.typical if self.log else self.null

    @property
    def spread(self) -> float:
        """The prior's standard deviation: ten times the typical size where none is given."""
        if self.prior_std is not None:
            return self.prior_std
        return 1.5 if self.log else 10 * self.typical


BELIEVED = 0.2
"""Standard deviation of a share that is all or nothing, about 1, once recordings ask for it."""


def share(meaning: str) -> Parameter:
    """Of what a simpler base lacks, or the body's equations leave out: 0 absent, 1 all of it.

    It is there whole or not at all, so it starts at 1 and is believed to be that, give or take
    `BELIEVED`: a flight at few heights says little of it by itself, and would foretell other
    heights with what its noise made of it. An estimate may come out a little beyond 0 and 1.
    """
    return Parameter("share", "–", 0.0, -0.3, 2.0, 0.2, meaning, prior_std=BELIEVED, start=1.0)


@dataclass(frozen=True)
class Effect:
    """One physical effect of the contract's table.

    ``axes`` is empty for an effect without one. ``order`` places it among the effects of the same
    stage (along the signal's path). ``separated_by`` names the plan that shows it best. ``starts``
    are values of its first parameter, rising, from the likeliest of which a fit starts: for an
    effect whose likelihood has no slope where it is absent. ``identifiable`` says what motion
    shows it, ``evidence`` against which variable it is drawn, one of `ABSCISSAE`. ``within`` names
    the term without which it means nothing; ``beside`` one without which it says no more than
    another effect does. One without parameters is a switch, no cause. One that is ``formal`` is a
    way of writing the body's equations: the base's own, and never a finding.
    """

    name: str
    summary: str
    parameters: tuple[Parameter, ...]
    hooks: Mapping[Stage, Hook]
    axes: tuple[str, ...] = ()
    order: int = 0
    confused_with: tuple[str, ...] = ()
    separated_by: str = ""
    starts: tuple[float, ...] = ()
    identifiable: str = ""
    evidence: str = ""
    within: str = ""
    beside: str = ""
    formal: bool = False
    extra: Mapping[str, str] = field(default_factory=dict)

    @property
    def of_base(self) -> bool:
        """Whether it is what a simpler base lacks or may be written without: no cause in the rig.

        Its share is believed beforehand, so it has no number that a fit could buy.
        """
        return self.formal or self.missing

    @property
    def missing(self) -> bool:
        """Whether every rig has it and only a simpler base lacks it."""
        return bool(self.within) and not self.formal

    @property
    def screened(self) -> bool:
        """Its trace in the innovations of a fit without it says whether it is there.

        Not so where ``starts`` are named (the likelihood has to be asked at those), nor for what
        has no hooks: clocks and lost samples are seen in the time stamps.
        """
        return bool(self.hooks) and not self.starts


@dataclass(frozen=True)
class Term:
    """An effect on its axis (None where it has none): what is switched on and off."""

    effect: Effect
    axis: str | None = None

    @property
    def name(self) -> str:
        return self.effect.name if self.axis is None else f"{self.effect.name}.{self.axis}"

    @property
    def evidence(self) -> str:
        """The variable against which its evidence is drawn, for its axis."""
        return self.effect.evidence.format(axis=self.axis)

    @property
    def axis_index(self) -> int:
        return -1 if self.axis is None else AXES.index(self.axis)
