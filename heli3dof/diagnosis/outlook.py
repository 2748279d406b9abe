"""Define a plan's expected result, the recommended plan, and terms that need another flight."""

from __future__ import annotations

from dataclasses import dataclass, field

from heli3dof.identification.greybox.multistep import MultiStepFit

MIN_CERTAINTY = 0.5
"""Certainty below which no plan is expected to give a decision. Chosen."""


@dataclass(frozen=True)
class PlanForecast:
    """Expected result of a plan: its evidence, in units of 2 ln L, and its ``certainty``.

    ``margins``: evidence for each simulated cause against the others (`planning.next_experiment`),
    or for each undecided parameter (`planning.free_run_plan`). Causes not simulated have none.
    ``certainty``: probability that a flight of the plan decides.
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
    """The recommended plan, the causes it separates, its ``certainty``, and all plans by rank."""

    plan: str
    separates: tuple[str, ...]
    why: str
    certainty: float | None
    ranking: tuple[PlanForecast, ...] = field(default=())


@dataclass(frozen=True, eq=False)
class UndecidedTerms:
    """Terms of a fit to free-run predictions on which a further flight should decide.

    They are a cause and those confounded with it. Without any, they are terms that improve held-out
    predictions but are no causes. Without these, they are terms that are not identifiable.
    """

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
