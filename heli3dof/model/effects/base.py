"""`Effect`, `Parameter`, `Term`: a physical effect (friction, lag …) that a model may contain.

Each file of this folder defines related effects in a tuple ``EFFECTS``, or a single one as
``EFFECT``. To add an effect, write a file with ``EFFECT = Effect(...)`` and the equation in its
docstring. Another package registers its `Effect` under the entry-point group ``heli3dof.effects``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan, nan
from typing import Literal

from heli3dof.axes import AXES
from heli3dof.model.physics.compiled_effects import Hook
from heli3dof.model.physics.state_layout import PARAMETERS, A, Stage

ABSCISSAE = (
    "roll", "pitch", "yaw", "roll_rate", "pitch_rate", "yaw_rate", "voltage_sum",
    "voltage_difference", "voltage_front", "voltage_back", "time",
)  # fmt: skip
"""Variables against which a report can plot an effect (`Effect.evidence`). An effect may also state
"{axis}" or "{axis}_rate": angle or rate of the axis on which it acts."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect: its ``unit``, its bounds and its prior in an estimation.

    Attributes:
        null: the value at which the effect is absent.
        low, high: bounds of an estimate. Where the equations allow negative values (friction),
            ``low`` is negative, so that zero does not cut off a confidence interval.
        typical: size of a deviation from ``null`` that has a noticeable effect on a rig. If ``log``
            is true, it is a typical value of the parameter instead. It scales the optimiser's
            steps and the default priors.
        log: if true, the logarithm is estimated (positive parameters only).
        prior_std: standard deviation of the weak prior about ``start``, in ``unit`` (of the
            logarithm if ``log``); default 10 · ``typical``, or 1.5 if ``log``.
        start: the starting value of a fit and mean of the prior; default ``null``, or ``typical``
            if ``log``.
        per_recording: if true, each recording has its own value, such as the phase of a periodic
            torque or the time of a change.
    """

    name: str
    unit: str
    null: float
    low: float
    high: float
    typical: float
    meaning: str
    log: bool = False
    prior_std: float = nan
    start: float = nan
    per_recording: bool = False

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ValueError(f"{self.name}: low is {self.low:g}, not below high, {self.high:g}")
        if not self.low <= self.null <= self.high and not self.log:
            raise ValueError(f"{self.name}: null is {self.null:g}, outside the bounds")
        if not self.typical > 0:
            raise ValueError(f"{self.name}: typical is {self.typical:g}, which is not positive")
        if isnan(self.start):
            object.__setattr__(self, "start", self.typical if self.log else self.null)
        if isnan(self.prior_std):
            object.__setattr__(self, "prior_std", 1.5 if self.log else 10 * self.typical)


SHARE_STD = 0.2
"""Standard deviation of the prior of a `share`; the mean is 1."""
SMALL = 0.1
"""Ratio of a parameter's deviation from its null value to `Parameter.typical`. At this ratio, the
motion is still nearly linear in the parameter."""


def share(meaning: str) -> Parameter:
    """Return a `Parameter` that scales a change of the equations: 0 none, 1 the whole change.

    ``meaning`` describes the change. The true value is 0 or 1. A fit of a model with this parameter
    starts at 1, with the prior N(1, `SHARE_STD`²). The estimate may lie slightly outside 0 … 1.
    """
    return Parameter("share", "–", 0.0, -0.3, 2.0, 0.2, meaning, prior_std=SHARE_STD, start=1.0)


@dataclass(frozen=True)
class Effect:
    """One physical effect, with the facts that a fit and a diagnosis need about it.

    Each parameter has a null value, at which the effect is absent: for example 0 for a friction
    (`Parameter.null`). An effect without parameters is a switch; a diagnosis does not report it.

    Attributes:
        hooks: the equations, as {stage of the simulation: function ``f(s, par, mem, out)`` that is
            called there} (`heli3dof.model.physics.state_layout.Stage`).
        axes: the axes (roll, pitch, yaw) on each of which the effect can occur separately. Empty
            for an effect that belongs to no single axis, such as the lag of the rotors.
        order: calling order among the effects of the same stage, along the signal path.
        confused_with: other effects that explain similar data.
        separated_by: name of the flight plan that best distinguishes this effect from
            ``confused_with``.
        starts: trial values of the first parameter, ascending. Only for an effect whose likelihood
            has zero slope at the null value. A fit starts at the null value or at one of these
            values, whichever explains the data best.
        identifiable: the motion that makes the effect identifiable.
        evidence: the variable against which a report plots the effect (`ABSCISSAE`).
        within: name of another effect, whose equations this effect changes. A diagnosis proposes
            this effect only if the model contains the other one.
        requires: name of another effect that the model must contain before a diagnosis proposes
            this effect. Otherwise the data could not distinguish this effect from a third one.
        formal: true if the effect selects a simplified form of the rigid body's equations of
            motion. A diagnosis may select it but never reports it as a finding, because the choice
            of equations is no defect of the rig.
        candidate: true if a diagnosis may propose it.
        probes: tuples of parameter values at which a diagnosis evaluates the score. A parameter
            that a tuple omits has its null value. Default: one tuple, the first parameter's null
            value + `SMALL` · ``typical``. Several tuples are needed if the shape of the predicted
            change depends on the value.
        probe_quantiles: for a voltage limit, instead of ``probes``: a diagnosis evaluates the score
            at these quantiles of the recorded |voltage|.
        scan: ``frequency`` if the second parameter is a frequency, ``instant`` if it is the time of
            a change. A diagnosis then evaluates the score at all values of this parameter
            (`heli3dof.identification.bias_correction.scans`).
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

    def __post_init__(self) -> None:
        if not isinstance(self.parameters, tuple):
            raise TypeError(f"{self.name}: parameters is not a tuple; a single one needs a comma")
        names = [p.name for p in self.parameters]
        if len(names) > PARAMETERS - A:
            raise ValueError(f"{self.name}: more than {PARAMETERS - A} parameters")
        if repeated := [n for n in names if names.count(n) > 1]:
            raise ValueError(f"{self.name}: two parameters have the name {repeated[0]!r}")
        if wrong_probes := [p for p in self.probes if not 1 <= len(p) <= len(names)]:
            raise ValueError(
                f"{self.name}: probes contains {wrong_probes[0]}, with {len(wrong_probes[0])} "
                f"values; the effect has {len(names)} parameter(s)"
            )
        if self.scan not in ("", "frequency", "instant") or (self.scan and len(names) < 2):
            raise ValueError(
                f"{self.name}: scan is {self.scan!r}; it must be frequency or instant, which needs "
                "a second parameter"
            )
        if list(self.starts) != sorted(self.starts):
            raise ValueError(f"{self.name}: starts does not ascend")
        if wrong := [a for a in self.axes if a not in AXES]:
            raise ValueError(f"{self.name}: axes contains {wrong[0]!r}; axes are {', '.join(AXES)}")
        if not all(isinstance(stage, Stage) for stage in self.hooks):
            raise TypeError(f"{self.name}: the keys of hooks are not Stage.TORQUE or another Stage")
        if wrong_hooks := [hook for hook in self.hooks.values() if not callable(hook)]:
            raise TypeError(f"{self.name}: hooks contains {wrong_hooks[0]!r}, not a function")
        known = (*ABSCISSAE, "{axis}", "{axis}_rate")
        if self.evidence and self.evidence not in known:
            raise ValueError(
                f"{self.name}: evidence is {self.evidence!r}, which is none of {', '.join(known)}"
            )

    @property
    def of_base(self) -> bool:
        """Return True if the effect selects a form of the equations of motion.

        Either it selects a simplified form of the rigid body's equations (`formal`), or it restores
        terms that a simplified form omits (`within`). No such effect is a defect of the rig. Its
        parameter has a narrow prior about 1 (`share`). Therefore, a diagnosis adds no BIC penalty
        for this parameter.
        """
        return self.formal or bool(self.within)

    @property
    def screened(self) -> bool:
        """Return True if a score test on innovations of a model without the effect can detect it.

        The result is False for effects with ``starts``: at the null value of their parameter, the
        score (slope of the log-likelihood) is zero. It is also False for effects without equations:
        jitter and lost samples, which time stamps show.
        """
        return bool(self.hooks) and not self.starts


@dataclass(frozen=True)
class Term:
    """An effect in a model, together with the axis (roll, pitch or yaw) on which it acts.

    ``axis`` is None for an effect that belongs to no single axis, such as the lag of the rotors.
    """

    effect: Effect
    axis: str | None = None

    @property
    def name(self) -> str:
        """Return the effect's name with the axis, for instance ``friction.coulomb.yaw``."""
        return self.effect.name if self.axis is None else f"{self.effect.name}.{self.axis}"

    @property
    def evidence(self) -> str:
        """Return the variable against which a report plots the effect, such as ``yaw_rate``."""
        return self.effect.evidence.format(axis=self.axis)

    @property
    def axis_index(self) -> int:
        """Return the index of ``axis``: 0 roll, 1 pitch, 2 yaw; −1 if ``axis`` is None."""
        return -1 if self.axis is None else AXES.index(self.axis)
