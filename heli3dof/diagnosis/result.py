"""The result of a diagnosis, from which the JSON document, the tables and the report are made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from typing import TYPE_CHECKING, Any

from heli3dof.arrays import FloatArray
from heli3dof.axes import AXES
from heli3dof.diagnosis import name_of
from heli3dof.diagnosis.base_parameters import BaseParameter, OffNominal
from heli3dof.diagnosis.search.select import Choice
from heli3dof.diagnosis.unmodelled.torque_formula import Proposal
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.gain import HORIZON_S, Gain, HeldOut
from heli3dof.diagnosis.validation.simulation_error import SimulationError
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.greybox.multistep import MultiStepFit
from heli3dof.integrity import Fault
from heli3dof.model.effects import Term
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.results import DOCUMENTS, SUMMARIES, Result, optional, registered

if TYPE_CHECKING:
    import pandas

MIN_CERTAINTY = 0.5
"""Certainty (probability of a decision) below which a plan is not expected to decide. Chosen."""
DOES_NOT_PAY = "held-out data do not confirm its gain"
COLOURED = "this recording's low-frequency noise explains as much"
WITHIN_A_COUNT = "an encoder error within one count explains as much"
WITHIN_ROUNDING = "predictions improve by less than the encoders' rounding"
LIMIT_CYCLE = "an encoder limit cycle may explain as much, and no flights could be simulated"
COMPENSATES = "it only compensated for an unmodelled torque"


@dataclass(frozen=True, eq=False)
class Finding:
    """A cause: the selection step that added it, its size, and its gain on held-out data.

    The gain is the decrease of the prediction error with the cause's term in the model.
    """

    choice: Choice
    values: Mapping[str, tuple[float, float]]
    """Parameter → (value, standard deviation) in the final fit, SI units"""
    gain: Gain
    """Gain of the model with all adopted causes, compared with its refit without this cause"""
    noise: FloatArray
    """(4,) noise (`Optimum.noise`) of the fit without this cause"""
    unconfirmed: bool = False
    """True for a likely but unconfirmed cause, "…-like": its size or its gain is not significant,
    the recordings do not confirm it, or it may only compensate for an unmodelled torque
    """

    def __repr__(self) -> str:
        sizes = (f"{name} = {value:.4g} ± {std:.2g}" for name, (value, std) in self.values.items())
        return f"Finding({self.term.name}: {', '.join(sizes)})"

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
    """A cause that forward selection had added to the model, but that a later test removed.

    ``why`` states the test's reason, for example that held-out data do not confirm the gain.
    """

    name: str
    gain: Gain
    why: str = DOES_NOT_PAY
    choice: Choice | None = None
    """The selection step that had added it, if any"""

    def __repr__(self) -> str:
        return f"Dropped({self.name}: {self.why})"


@dataclass(frozen=True, eq=False)
class Fitted:
    """The results of a diagnosis whose recordings could be fitted.

    The base simulation is the model to which the diagnosis adds effects: the rigid body, usually
    without effects. With the added effects it is the extended model.
    """

    base: CorrectedFit | None
    final: CorrectedFit | None
    """Fits of the base simulation and of the extended model; None without a likelihood"""
    model: GreyBoxModel
    gain: Gain
    """Gain of the extended model over the refitted base simulation"""
    before: HeldOut | None
    after: HeldOut | None
    """Results on held-out data of the refitted base simulation and of the extended model"""
    simulation_error: SimulationError
    """Prediction errors of the simulation with the profile's parameter values, and the noise floor
    of the extended model"""
    refit: Gain | None = None
    """Gain of the refitted base simulation over the simulation with the profile's values"""
    refit_with_causes: Gain | None = None
    """Gain of the extended model over itself with trim torque and inertias of the profile; None
    without causes or without a likelihood"""
    calibration: tuple[BaseParameter, ...] = ()
    """The base parameters of the extended model"""
    open: UndecidedTerms | None = None
    """Terms about which a further flight should decide; None if a likelihood was fitted, or if the
    extended model was not adopted"""

    @property
    def predicts_worse(self) -> bool:
        """Return whether the extended model predicts much worse than the uncalibrated simulation.

        This simulation has the profile's parameter values. The compared number is the mean square
        error on held-out data, summed over the axes. The limit is 1.5 times that of the simulation.
        """
        if self.refit is None:
            return False
        e_0, e_1 = (
            sum((x or 0.0) ** 2 for x in e.values()) for e in (self.refit.before, self.gain.after)
        )
        return e_1 > 1.5 * e_0

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
    """The error that remains on one axis, as RMSE (°) of predictions `HORIZON_S` ahead."""

    axis: str
    simulation_deg: float
    """Error on held-out data of the simulation with the profile's parameter values"""
    extended_deg: float
    """Error of the extended model on the same data"""
    noise_deg: float | None
    """Noise floor; None if it is unknown"""


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Result):
    """The result of `heli3dof.diagnose`: the verdict, the causes and the extended model."""

    recordings: tuple[str, ...]
    holdout: tuple[str, ...]
    verdict: str
    integrity: tuple[Fault, ...]
    fitted: Fitted | None = None
    """None if the recordings are faulty"""
    findings: tuple[Finding, ...] = ()
    """Causes in the order of selection; `in_order` sorts them by their gain"""
    calibration_findings: tuple[OffNominal, ...] = ()
    """Base parameters that differ from nominal by more than the profile's tolerance"""
    dropped: tuple[Dropped, ...] = ()
    residual_torques: tuple[ResidualTorque, ...] = ()
    remainders: tuple[UnexplainedError, ...] = ()
    """Errors that neither causes nor noise explain (`conclusion.verdict`)"""
    slow_noise: tuple[ResidualTorque, ...] = ()
    """Residual torques that depend on time only, such as a draught's: no model can predict them"""
    not_identifiable: tuple[str, ...] = ()
    """Terms that these recordings could not reveal even at a large size"""
    about: Mapping[str, Any] = field(default_factory=dict)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Return the faults of the recordings that are causes of simulation errors.

        These are the faults that name an effect. Their kind is ``finding``.
        """
        return tuple(f for f in self.integrity if f.is_cause)

    @property
    def in_order(self) -> tuple[Fault | Finding | OffNominal, ...]:
        """Return all causes, in the order of the module's function `in_order`."""
        return in_order(self.faults, self.findings, self.calibration_findings)

    @property
    def likely_effects(self) -> tuple[str, ...]:
        """Return the effects of the catalogue that the residual torques resemble.

        The result is empty unless each residual torque resembles an effect, and no other error
        remains unexplained.
        """
        names = [x.likely_effect for x in self.residual_torques]
        known = [name for name in names if name is not None]
        return () if self.remainders or len(known) < len(names) else tuple(dict.fromkeys(known))

    def summary(self) -> str:
        """Return the text that ``heli3dof diagnose`` prints: verdict, causes, gain, next step."""
        text: str = registered(SUMMARIES, "Diagnosis")(self.to_dict())
        return text

    def __repr__(self) -> str:
        return self.summary()  # its first three lines would hide causes

    def to_dict(
        self, model: str | None = None, upcoming: NextExperiment | None = None
    ) -> dict[str, Any]:
        """Return the JSON document of ``diagnose --json``; see `heli3dof.diagnosis_document`."""
        document: dict[str, Any] = registered(DOCUMENTS, "Diagnosis")(self, model, upcoming)
        return document

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a pandas data frame with a row per cause and parameter, in the causes' order.

        Formulas of unmodelled torques are the last rows: ``empirical.yaw.1: c * pitch_rate``, with
        the parameter ``c``. Columns: ``value``, ``std``, ``score``, ``confidence``. Raises
        UsageError if pandas is missing.
        """
        document = self.to_dict()
        causes = [(name_of(c), c["parameters"], c) for c in document["findings"]]
        causes += [
            (f"{x['term']}: {x['formula']}", x["formula_parameters"], x)
            for x in document["leftover"]
        ]
        rows = [
            {"cause": name, "parameter": parameter, "value": size["value"],
             "std": size["std"], "score": cause["score"], "confidence": cause["confidence"]}
            for name, parameters, cause in causes
            for parameter, size in parameters.items()
        ]  # fmt: skip
        columns = ["cause", "parameter", "value", "std", "score", "confidence"]
        frame = optional("pandas").DataFrame(rows, columns=columns)
        return frame.set_index(["cause", "parameter"])


def in_order(
    faults: Sequence[Fault], findings: Sequence[Finding], off: Sequence[OffNominal]
) -> tuple[Fault | Finding | OffNominal, ...]:
    """Return all causes: findings and base parameters, then faults of the recordings.

    The findings are sorted by falling gain, which is the increase in the log-likelihood of held-out
    data (`by_gain`). ``off`` contains the base parameters (thrust gain, trim torque, inertias) that
    differ from nominal. They have no such gain, but a score. So each of them is inserted before the
    first finding with a lower score (`Finding.score`, `OffNominal.score`).
    """
    return in_order_of_selection(faults, by_gain(findings), off)


def in_order_of_selection(
    faults: Sequence[Fault], findings: Sequence[Finding], off: Sequence[OffNominal]
) -> tuple[Fault | Finding | OffNominal, ...]:
    """Return all causes: findings and base parameters, then faults of the recordings.

    The ``findings`` keep their order. ``off`` contains the base parameters (thrust gain, trim
    torque, inertias) that differ from nominal. Each of them is inserted before the first finding
    with a lower score (`Finding.score`, `OffNominal.score`). The faults are last, because they
    explain little error: the fit allows for lost samples and jitter.
    """
    out: list[Finding | OffNominal] = list(findings)
    for o in sorted(off, key=lambda o: o.score):
        weaker = (k for k, f in enumerate(out) if f.score < o.score)
        out.insert(next(weaker, len(out)), o)
    return (*out, *faults)


def by_gain(findings: Sequence[Finding]) -> list[Finding]:
    """Return the findings, sorted by their gain: the one with the largest gain is first.

    The gain is the increase of the log-likelihood of held-out data. Findings without this gain are
    last, in the given order.
    """

    def gain(f: Finding) -> float:
        won = f.gain.log_likelihood
        return -inf if won is None else won.value

    return sorted(findings, key=gain, reverse=True)


def physical(causes: Sequence[Fault | Finding | OffNominal]) -> list[Finding | OffNominal]:
    """Return the causes that are properties of the rig; faults of recordings are omitted."""
    return [f for f in causes if not isinstance(f, Fault)]


@dataclass(frozen=True)
class PlanForecast:
    """Expected result of a flight of one plan: the evidence that it gives, and its ``certainty``.

    ``margins``: evidence, as a difference of 2 ln L, for each simulated cause against the others
    (`planning.next_experiment`), or for each undecided parameter (`planning.free_run_plan`).
    ``certainty``: probability that this evidence suffices for a decision. ``scores``: evidence for
    each simulated cause against the model without causes.
    """

    plan: str
    duration_s: float
    margins: tuple[float, ...]
    certainty: float
    scores: tuple[float, ...] = ()

    @property
    def margin(self) -> float:
        return min(self.margins)


@dataclass(frozen=True)
class NextExperiment:
    """The recommended plan, and the causes between which a flight of this plan should decide.

    ``plan`` is None if no plan separates them; ``why`` states the reason. ``certainty``:
    probability that such a flight decides. ``ranking``: all plans, the best first.
    """

    plan: str | None
    separates: tuple[str, ...]
    why: str
    certainty: float | None
    ranking: tuple[PlanForecast, ...] = field(default=())


@dataclass(frozen=True, eq=False)
class UndecidedTerms:
    """Terms about which a further flight should give a decision (`cause_selection.open_terms`)."""

    fit: MultiStepFit
    names: tuple[str, ...]
    """Names of the terms, most important first"""
    tied: bool = False
    """True if the terms are confounded"""


def percent(probability: float) -> str:
    """Return a forecast probability as text, never as 100 %.

    >>> percent(0.999), percent(0.873)
    ('> 99 %', '87 %')
    """
    return "> 99 %" if probability > 0.99 else f"{probability * 100:.0f} %"
