"""Define the expected result of a simulated plan, the recommended plan, and a fit's open terms."""

from __future__ import annotations

from dataclasses import dataclass, field

from heli3dof.identification.greybox.multistep import MultiStepFit
from heli3dof.model.greybox.model import GreyBoxModel

MIN_CERTAINTY = 0.5
"""Certainty below which no plan is expected to give a decision. Chosen."""


@dataclass(frozen=True)
class Outlook:
    """Expected result of a plan: margins in units of 2 ln L, and the probability of a decision.

    ``margins``: one for each simulated cause (`planning.next_experiment`) or open parameter
    (`planning.free_run_plan`). A plan worse than the best may lack the margins of some causes.
    """

    plan: str
    duration_s: float
    margins: tuple[float, ...]
    certainty: float

    @property
    def margin(self) -> float:
        return min(self.margins)


@dataclass(frozen=True)
class NextExperiment:
    """The recommended plan: causes it separates, probability of a decision, plans by rank."""

    plan: str
    separates: tuple[str, ...]
    why: str
    certainty: float | None
    ranking: tuple[Outlook, ...] = field(default=())


@dataclass(frozen=True, eq=False)
class OpenTerms:
    """Terms of a fit to free-run predictions on which a further flight should decide.

    They are confounded causes; else terms that held-out blocks need but that are no causes; else
    terms that are not identifiable.
    """

    fit: MultiStepFit
    model: GreyBoxModel
    """The fitted model, to be simulated"""
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
