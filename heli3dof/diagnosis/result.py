"""What a diagnosis found: one frozen result, which the document, the tables and the report read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from heli3dof.arrays import FloatArray
from heli3dof.diagnosis.estimate.base_parameters import BaseParameter, OffNominal
from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit
from heli3dof.diagnosis.integrity import Fault
from heli3dof.diagnosis.outlook import Open
from heli3dof.diagnosis.selection.select import Choice
from heli3dof.diagnosis.unmodelled.torque_formula import Proposal
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.gain import Gain, HeldOut
from heli3dof.diagnosis.validation.simulation_error import HowWrong
from heli3dof.model.greybox.model import GreyBoxModel

DOES_NOT_PAY = "held-out data do not confirm its gain"
COLOURED = "this recording's low-frequency noise explains as much"
WITHIN_A_COUNT = "an encoder error within one count explains as much"
STANDS_IN = "it only compensated for an unmodelled torque"


@dataclass(frozen=True, eq=False)
class Finding:
    """A cause: its term, the step in which it was taken, and what it gains on unseen data."""

    choice: Choice
    values: Mapping[str, tuple[float, float]]
    """Parameter → (value, standard deviation) in the final fit, SI"""
    gain: Gain
    """Everything found without this one (refitted) → everything found"""
    noise: FloatArray
    """(4,) of that fit without it, as `Optimum.noise`: with it a filter sees what is missing"""
    like: bool = False
    """Beside what is left without a name it is not sure any more, or data not seen do not surely
    confirm it, or it may be what is wrong with another one's formula: "…-like\""""


@dataclass(frozen=True, eq=False)
class Dropped:
    """A cause that was found and not adopted."""

    name: str
    gain: Gain
    why: str = DOES_NOT_PAY
    choice: Choice | None = None
    """The step in which it had been taken, where it had been one"""


@dataclass(frozen=True, eq=False)
class Fitted:
    """What there is once the recordings could be fitted."""

    base: CorrectedFit | None
    final: CorrectedFit | None
    """None where no likelihood was fitted (`free_run.diagnose_free_run`)"""
    model: GreyBoxModel
    gain: Gain
    """The base simulation refitted → the extended one"""
    before: HeldOut | None
    after: HeldOut | None
    wrong: HowWrong
    """The simulation as the profile has it, beside the extended model's noise floor"""
    noise_floor: Mapping[str, float | None]
    refit: Gain | None = None
    """The simulation as the profile has it → the base simulation refitted"""
    calibration: tuple[BaseParameter, ...] = ()
    """Where there is no ``final`` to read it from"""
    open: Open | None = None
    """What a fit to free flights left open; None where a likelihood was fitted"""


@dataclass(frozen=True, eq=False)
class TorqueTerm:
    """The term of the extended model for one unmodelled torque."""

    proposal: Proposal
    values: dict[str, tuple[float, float]]
    """Parameter → (value, standard deviation) in the extended model, SI"""
    units: dict[str, str]
    gain: Gain
    """The model without this torque → with it"""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What was found; `heli3dof.diagnosis.document` makes the contract's JSON of it."""

    recordings: tuple[str, ...]
    holdout: tuple[str, ...]
    verdict: str
    integrity: tuple[Fault, ...]
    fitted: Fitted | None = None
    """None where the recordings themselves are at fault"""
    findings: tuple[Finding, ...] = ()
    calibration_findings: tuple[OffNominal, ...] = ()
    """Base parameters off their nominal by more than the profile's tolerance"""
    dropped: tuple[Dropped, ...] = ()
    leftovers: tuple[ResidualTorque, ...] = ()
    torque_terms: tuple[TorqueTerm | None, ...] = ()
    """The extended model's term for each of ``leftovers``; None: it contains none"""
    not_identifiable: tuple[str, ...] = ()
    about: Mapping[str, Any] = field(default_factory=dict)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Findings of the integrity checks: causes in the recording itself, with a size."""
        return tuple(f for f in self.integrity if f.kind == "finding")

    @property
    def in_order(self) -> tuple[Fault | Finding | OffNominal, ...]:
        """All of them as `in_order` has it."""
        return in_order(self.faults, self.findings, self.calibration_findings)


def in_order(
    faults: Sequence[Fault], findings: Sequence[Finding], off: Sequence[OffNominal]
) -> tuple[Fault | Finding | OffNominal, ...]:
    """The strongest first: what is wrong with the recording, then causes as they were found, each
    base number before the first of them that it is stronger than."""
    out: list[Finding | OffNominal] = list(findings)
    for o in sorted(off, key=lambda o: o.score):
        weaker = (k for k, f in enumerate(out) if _score(f) < o.score)
        out.insert(next(weaker, len(out)), o)
    return (*faults, *out)


def physical(found: Sequence[Fault | Finding | OffNominal]) -> list[Finding | OffNominal]:
    """Return the causes in the rig: without the faults of the recordings."""
    return [f for f in found if not isinstance(f, Fault)]


def verdict_of(
    findings: Sequence[Fault | Finding | OffNominal],
    left: Sequence[ResidualTorque],
    refit: Gain | None = None,
    *,
    unsure: bool = False,
) -> str:
    """Return the verdict on causes in the order of `in_order`.

    ``refit``: the gain of refitting the profile's own numbers. ``unsure``: the first physical cause
    may be another one. Faults of a recording are causes too, but never hide an ambiguous one.
    """
    if left:
        return "unexplained"
    causes = physical(findings)
    if not causes:
        if refit is not None and refit.of_calibration:
            return "off_calibration"
        return "explained" if findings else "nothing_found"
    first = causes[0]
    tied = first.choice.tied_with if isinstance(first, Finding) else first.tied_with
    return "ambiguous" if tied or unsure else "explained"


def tied_in(found: Sequence[Fault | Finding | OffNominal]) -> tuple[str, ...]:
    """Every name that one of them is tied with, or is."""
    out: list[str] = []
    for f in found:
        if isinstance(f, Fault):
            out.append(f"{f.effect}.{f.axis}")
        else:
            out += f.choice.tied_with if isinstance(f, Finding) else f.tied_with
    return tuple(out)


def _score(found: Finding | OffNominal) -> float:
    return found.score if isinstance(found, OffNominal) else found.choice.score
