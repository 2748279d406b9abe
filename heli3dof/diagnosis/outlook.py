"""What flights would show: the outlook of a plan, and the plan that is recommended."""

from __future__ import annotations

from dataclasses import dataclass, field

from heli3dof.identification.greybox.multistep import MultiStepFit
from heli3dof.model.greybox.model import GreyBoxModel

HOPELESS = 0.5
"""Certainty below which no plan is promised to settle it."""


@dataclass(frozen=True)
class Outlook:
    """What one plan would show: margins of the truths it was flown on (the unit of 2 ln L), and
    the chance. Of the best plan that is all of them; of one that it beats, perhaps the first."""

    plan: str
    duration_s: float
    margins: tuple[float, ...]
    certainty: float

    @property
    def margin(self) -> float:
        return min(self.margins)


@dataclass(frozen=True)
class NextExperiment:
    """The plan to fly, what it separates, the chance that it does, and all plans, best first (those
    below the best by what they promise at most)."""

    plan: str
    separates: tuple[str, ...]
    why: str
    certainty: float | None
    ranking: tuple[Outlook, ...] = field(default=())


@dataclass(frozen=True, eq=False)
class Open:
    """What a fit leaves open: terms that were needed and not surely sized, or not seen at all."""

    fit: MultiStepFit
    model: GreyBoxModel
    """The fitted rig, to be flown"""
    names: tuple[str, ...]
    """The most urgent first"""
    tied: bool = False
    """They fit as well in one another's place."""


def percent(chance: float) -> str:
    """Never 100 %: it is a forecast.

    >>> percent(0.999), percent(0.873)
    ('> 99 %', '87 %')
    """
    return "> 99 %" if chance > 0.99 else f"{chance * 100:.0f} %"
