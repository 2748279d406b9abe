"""The result of a diagnosis, from which the JSON document, the tables and the report are made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

from heli3dof.arrays import FloatArray
from heli3dof.axes import AXES
from heli3dof.diagnosis.base_parameters import BaseParameter, OffNominal
from heli3dof.diagnosis.outlook import UndecidedTerms
from heli3dof.diagnosis.selection.select import Choice
from heli3dof.diagnosis.unmodelled.torque_formula import Proposal
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.gain import HORIZON_S, Gain, HeldOut
from heli3dof.diagnosis.validation.simulation_error import SimulationError
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.integrity import Fault
from heli3dof.model.effects import Term
from heli3dof.model.greybox.model import GreyBoxModel

DOES_NOT_PAY = "held-out data do not confirm its gain"
COLOURED = "this recording's low-frequency noise explains as much"
WITHIN_A_COUNT = "an encoder error within one count explains as much"
WITHIN_ROUNDING = "predictions improve by less than the encoders' rounding"
LIMIT_CYCLE = "an encoder limit cycle may explain as much, and no flights could be simulated"
STANDS_IN = "it only compensated for an unmodelled torque"


@dataclass(frozen=True, eq=False)
class Finding:
    """A cause: the selection step that added it, its size, and its gain on held-out data.

    The gain is the decrease of the prediction error by the cause's term.
    """

    choice: Choice
    values: Mapping[str, tuple[float, float]]
    """Parameter → (value, standard deviation) in the final fit, SI units"""
    gain: Gain
    """Gain of the model with all adopted causes over the same model refitted without this cause"""
    noise: FloatArray
    """(4,) noise (`Optimum.noise`) of the fit without this cause"""
    unconfirmed: bool = False
    """True for a likely but unconfirmed cause, "…-like": its size or its gain is not significant,
    the recordings do not confirm it, or it may only compensate for an unmodelled torque
    """

    @property
    def term(self) -> Term:
        return self.choice.term

    @property
    def score(self) -> float:
        return self.choice.score

    @property
    def tied_with(self) -> tuple[str, ...]:
        return self.choice.tied_with


@dataclass(frozen=True, eq=False)
class Dropped:
    """A cause that was selected but not adopted."""

    name: str
    gain: Gain
    why: str = DOES_NOT_PAY
    choice: Choice | None = None
    """The selection step that had added it, if any"""


@dataclass(frozen=True, eq=False)
class Fitted:
    """The results of a diagnosis whose recordings could be fitted."""

    base: CorrectedFit | None
    final: CorrectedFit | None
    """Fits of the base simulation and with the causes; None if no likelihood was fitted"""
    model: GreyBoxModel
    gain: Gain
    """Gain of the extended model over the refitted base simulation"""
    before: HeldOut | None
    after: HeldOut | None
    """Results on held-out data of the refitted base simulation and of the extended model"""
    simulation_error: SimulationError
    """Prediction errors with the profile's numbers, and the extended model's noise floor"""
    refit: Gain | None = None
    """Gain of the refitted base simulation over the one with the profile's numbers"""
    calibration: tuple[BaseParameter, ...] = ()
    """The base parameters of the fit with the causes"""
    open: UndecidedTerms | None = None
    """Open terms; None if a likelihood was fitted, or the extended model was not adopted"""

    @property
    def noise_floor(self) -> dict[str, float | None]:
        """Return {axis: noise floor (°) of predictions `HORIZON_S` ahead; None if unknown}."""
        floor = {a: self.simulation_error.at(HORIZON_S, a)[1] for a in AXES}
        return {a: x if isfinite(x) else None for a, x in floor.items()}


@dataclass(frozen=True, eq=False)
class TorqueTerm:
    """The term of the extended model for one unmodelled torque."""

    proposal: Proposal
    values: dict[str, tuple[float, float]]
    """Parameter → (value, standard deviation) in the extended model, SI units"""
    gain: Gain
    """Gain of the model with this torque over the model without"""


@dataclass(frozen=True)
class UnexplainedError:
    """An axis on which most of the error remains: RMSE (°) of predictions `HORIZON_S` ahead."""

    axis: str
    simulation_deg: float
    """Error of the simulation with the profile's numbers"""
    extended_deg: float
    """Error of the extended model; both on held-out data"""
    noise_deg: float | None
    """Noise floor; None if it is unknown"""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The result of a diagnosis; `heli3dof.diagnosis.document` converts it to JSON."""

    recordings: tuple[str, ...]
    holdout: tuple[str, ...]
    verdict: str
    integrity: tuple[Fault, ...]
    fitted: Fitted | None = None
    """None if the recordings are faulty"""
    findings: tuple[Finding, ...] = ()
    calibration_findings: tuple[OffNominal, ...] = ()
    """Base parameters that differ from nominal by more than the profile's tolerance"""
    dropped: tuple[Dropped, ...] = ()
    residual_torques: tuple[ResidualTorque, ...] = ()
    remainders: tuple[UnexplainedError, ...] = ()
    """Errors that neither causes nor noise explain, see `remainders`"""
    slow_noise: tuple[ResidualTorque, ...] = ()
    """Residual torques that depend on time only, such as a draught's: no model can predict them"""
    not_identifiable: tuple[str, ...] = ()
    """Terms that these recordings could not reveal even at a large size"""
    about: Mapping[str, Any] = field(default_factory=dict)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Return the recordings' faults of the kind "finding" that name an effect: causes."""
        return tuple(f for f in self.integrity if f.is_cause)

    @property
    def in_order(self) -> tuple[Fault | Finding | OffNominal, ...]:
        """Return faults, findings and base parameters off nominal in the order of `in_order`."""
        return in_order(self.faults, self.findings, self.calibration_findings)


def in_order(
    faults: Sequence[Fault], findings: Sequence[Finding], off: Sequence[OffNominal]
) -> tuple[Fault | Finding | OffNominal, ...]:
    """Return all causes: the faults of the recordings, then the findings in the order of selection.

    Each base parameter off nominal is inserted before the first finding with a lower score.
    """
    out: list[Finding | OffNominal] = list(findings)
    for o in sorted(off, key=lambda o: o.score):
        weaker = (k for k, f in enumerate(out) if f.score < o.score)
        out.insert(next(weaker, len(out)), o)
    return (*faults, *out)


def physical(causes: Sequence[Fault | Finding | OffNominal]) -> list[Finding | OffNominal]:
    """Return the causes in the rig, without the faults of the recordings."""
    return [f for f in causes if not isinstance(f, Fault)]


def verdict_of(
    findings: Sequence[Fault | Finding | OffNominal],
    left: Sequence[ResidualTorque | UnexplainedError],
    refit: Gain | None = None,
    *,
    ambiguous: bool = False,
) -> str:
    """Return the verdict, such as "explained", on the ``findings``, which `in_order` has ordered.

    ``left``: the residual torques, and the errors that the causes leave (`remainders`).
    ``refit``: the gain of refitting the profile's numbers. ``ambiguous``: the first physical cause
    is uncertain. Faults of a recording affect the verdict only if there is no physical cause.
    """
    if left:
        return "unexplained"
    causes = physical(findings)
    if not causes:
        if refit is not None and refit.of_calibration:
            return "off_calibration"
        return "explained" if findings else "nothing_found"
    return "ambiguous" if causes[0].tied_with or ambiguous else "explained"


def remainders(
    f: Fitted,
    findings: Sequence[Fault | Finding | OffNominal],
    slow_noise: Sequence[ResidualTorque] = (),
) -> tuple[UnexplainedError, ...]:
    """Return the errors that remain, largest first; empty if the causes explain most of the error.

    On held-out data, e_0 is the RMSE of the simulation with the profile's numbers and e_1 that of
    the extended model; e_n is the noise floor (0 if unknown). Most of the error remains if, with
    sums over the axes,

        Σ max(e_1² − e_n², 0) > ½ Σ e_0²

    The result contains the axes that satisfy this inequality on their own. An axis with slow noise
    and without a noise floor is left out. Without a physical cause there is no claim to refute, so
    the result is empty.
    """
    if not physical(findings) or f.refit is None:
        return ()
    each = []
    slow = {x.axis for x in slow_noise}
    for axis in AXES:
        e_0, e_1 = f.refit.before.get(axis), f.gain.after.get(axis)
        e_n = f.simulation_error.at(HORIZON_S, axis)[1]
        if axis in slow and not isfinite(e_n):
            continue
        if e_0 is not None and e_1 is not None and isfinite(e_0) and isfinite(e_1):
            each.append(UnexplainedError(axis, e_0, e_1, e_n if isfinite(e_n) else None))
    if sum(map(_unexplained, each)) <= sum(r.simulation_deg**2 for r in each) / 2:
        return ()
    most = (r for r in each if _unexplained(r) > r.simulation_deg**2 / 2)
    return tuple(sorted(most, key=_unexplained, reverse=True))


def _unexplained(r: UnexplainedError) -> float:
    """Return the mean square in deg² that neither the extended model nor noise explains."""
    return float(max(r.extended_deg**2 - (r.noise_deg or 0.0) ** 2, 0.0))


def confounded_names(causes: Sequence[Fault | Finding | OffNominal]) -> tuple[str, ...]:
    """Return the names of effects that are faults of a recording, or confounded with a cause."""
    names: list[str] = []
    for f in causes:
        if isinstance(f, Fault):
            names.append(f"{f.effect}.{f.axis}")
        else:
            names += f.tied_with
    return tuple(names)
