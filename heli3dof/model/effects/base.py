"""`Effect`, `Parameter` and `Term`: a physical effect is parameters and functions for its stages.

To add an effect, write one file in this folder with ``EFFECT = Effect(...)`` and the equation in
its docstring, or register such an object under the entry-point group ``heli3dof.effects``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from heli3dof.axes import AXES
from heli3dof.model.physics.compiled_effects import Hook
from heli3dof.model.physics.state_layout import Stage

ABSCISSAE = (
    "roll", "pitch", "yaw", "roll_rate", "pitch_rate", "yaw_rate", "voltage_sum",
    "voltage_difference", "voltage_front", "voltage_back", "time",
)  # fmt: skip
"""Variables against which a report plots an effect; ``{axis}`` stands for the term's axis."""


@dataclass(frozen=True)
class Parameter:
    """One number of an effect, in ``unit``.

    Attributes:
        null: the value at which the effect is absent.
        low, high: bounds of estimates, the physically possible range. Friction may be slightly
            negative: a confidence interval that is cut off at zero is wrong.
        typical: a size that matters on a rig; sets starting values, steps and weak priors.
        log: estimated as its logarithm (for positive parameters that are never zero).
        prior_std: standard deviation of the weak prior about ``start``, in ``unit`` (of the
            logarithm if ``log``).
        start: the starting value of a fit; default ``null`` (``typical`` if ``log``).
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
        """The starting value of a fit."""
        if self.start is not None:
            return self.start
        return self.typical if self.log else self.null

    @property
    def spread(self) -> float:
        """The prior's standard deviation; by default ten times the typical size."""
        if self.prior_std is not None:
            return self.prior_std
        return 1.5 if self.log else 10 * self.typical


SHARE_STD = 0.2
"""Prior standard deviation about 1 of a share that is either 0 or 1, once it is in the model."""
SMALL = 0.1
"""Share of a parameter's typical size at which an effect is still linear in it."""


def share(meaning: str) -> Parameter:
    """The share of a part of the equations: 0 absent, 1 complete.

    A rig has that part completely or not at all. So a fit starts at 1, with the prior `SHARE_STD`:
    a flight at few heights determines the share poorly, and a free estimate would predict other
    heights badly. An estimate may lie slightly outside 0 … 1.
    """
    return Parameter("share", "–", 0.0, -0.3, 2.0, 0.2, meaning, prior_std=SHARE_STD, start=1.0)


@dataclass(frozen=True)
class Effect:
    """One physical effect of the contract's table.

    Attributes:
        hooks: functions ``f(s, par, mem, out)`` by stage (`heli3dof.model.physics.state_layout`).
        axes: the axes on which it can act; empty for an effect without an axis.
        order: its place among the effects of the same stage, along the signal path.
        confused_with: effects that explain similar data.
        separated_by: the named plan that distinguishes it best from those.
        starts: values of the first parameter, ascending, at which a fit evaluates the likelihood to
            choose its start. For effects whose likelihood has zero slope at null.
        identifiable: the motion that makes it identifiable.
        evidence: the variable against which a report plots it, one of `ABSCISSAE`.
        within: a term without which it is undefined.
        requires: a term without which it is equivalent to another effect.
        formal: it is a form of the body's equations, part of the base and never a finding.
        candidate: whether a diagnosis may propose it.
        probes: parameter values at which a diagnosis evaluates its score, the simplest first; the
            parameters left out are at null. Default: the first one at `SMALL` of its typical size.
            An effect whose trace changes its shape with its size needs several.
        probe_quantiles: for a limit of the voltage: the quantiles of |V| to evaluate in place of
            ``probes``.
        scan: evaluate all values of the second parameter at once: every ``frequency`` or every
            ``instant`` (`heli3dof.diagnosis.scans`).

    An effect without parameters is a switch and never a finding.
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
    requires: str = ""
    formal: bool = False
    candidate: bool = True
    probes: tuple[tuple[float, ...], ...] = ()
    probe_quantiles: tuple[float, ...] = ()
    scan: Literal["", "frequency", "instant"] = ""

    @property
    def of_base(self) -> bool:
        """True for a part of the body's equations, which is no finding about the rig.

        Its share has a tight prior, so that a model is not penalised for it as for a parameter.
        """
        return self.formal or self.missing

    @property
    def missing(self) -> bool:
        """True for what every rig has and only a simpler base model omits."""
        return bool(self.within) and not self.formal

    @property
    def screened(self) -> bool:
        """True if the innovations of a fit without it show whether it is present.

        Not if it has ``starts`` (the likelihood must be evaluated at those), nor without hooks
        (time stamps show sampling jitter and lost samples).
        """
        return bool(self.hooks) and not self.starts


@dataclass(frozen=True)
class Term:
    """An effect on one axis (None for an effect without axes), as a model contains it."""

    effect: Effect
    axis: str | None = None

    @property
    def name(self) -> str:
        """For instance ``friction.coulomb.yaw``."""
        return self.effect.name if self.axis is None else f"{self.effect.name}.{self.axis}"

    @property
    def evidence(self) -> str:
        """The variable against which a report plots it, with its axis filled in."""
        return self.effect.evidence.format(axis=self.axis)

    @property
    def axis_index(self) -> int:
        """0 roll, 1 pitch, 2 yaw; −1 without an axis."""
        return -1 if self.axis is None else AXES.index(self.axis)
