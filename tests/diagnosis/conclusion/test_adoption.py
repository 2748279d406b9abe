"""Causes are adopted for their gain on held-out data; adopted causes are not confounded."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.conclusion.adoption import (
    coloured_noise_margin,
    pays_enough,
    size_confidence,
    without_mutual_ties,
)
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit
from heli3dof.diagnosis.selection.select import SUFFICIENT, Choice
from heli3dof.diagnosis.validation.gain import Interval
from heli3dof.model.effects import terms

NONE = cast(Any, None)


def choice(score: float, tied: tuple[str, ...], **others: float) -> Choice:
    """Choice among effects by name (``__`` for a dot) and score; the first is the cause."""
    fits = tuple(
        CandidateFit(terms([n.replace("__", ".")])[0], NONE, NONE, s, s, 0)
        for n, s in others.items()
    )
    return Choice(fits[0].term, score, score, 0.5, tied, fits)


def gained(value: float, low: float, less_deg: float = -0.001) -> Any:
    """Gain in log-likelihood, and in degrees on roll by at least ``less_deg``."""
    rmse = {"roll": Interval(0.03, less_deg, 0.05), "pitch": None}
    return SimpleNamespace(log_likelihood=Interval(value, low, 2 * value), rmse_deg=rmse)


YAW = "disturbance.periodic.yaw"
ROLL = "disturbance.periodic.roll"
DRAG = "drag.quadratic.yaw"


def test_causes_that_are_both_adopted_are_not_confounded_with_each_other() -> None:
    first = choice(176.0, (ROLL,), disturbance__periodic__yaw=176.0,
                   disturbance__periodic__roll=175.5, drag__quadratic__yaw=160.0)  # fmt: skip
    second = choice(613.0, (), disturbance__periodic__roll=613.0)
    a, b = without_mutual_ties([first, second])
    assert (a.tied_with, b.tied_with) == ((), ())
    # Against the drag: 1 / (1 + exp(−(176 − 160)/2))
    assert a.confidence == pytest.approx(0.99966, abs=1e-5)
    assert b.confidence == second.confidence


def test_a_cause_stays_confounded_with_an_absent_one() -> None:
    first = choice(176.0, (ROLL, DRAG), disturbance__periodic__yaw=176.0,
                   disturbance__periodic__roll=175.5, drag__quadratic__yaw=176.0)  # fmt: skip
    assert without_mutual_ties([first])[0].tied_with == (ROLL, DRAG)
    (a, _) = without_mutual_ties([first, choice(613.0, (), disturbance__periodic__roll=613.0)])
    assert a.tied_with == (DRAG,)
    assert a.confidence == pytest.approx(0.5)


def test_a_cause_is_not_confounded_with_an_adopted_form_of_the_equations() -> None:
    name = "simplified.yaw_inertia"
    first = choice(176.0, (name,), drag__quadratic__yaw=176.0, simplified__yaw_inertia=175.5)
    assert without_mutual_ties([first])[0].tied_with == (name,)
    assert without_mutual_ties([first], [name])[0].tied_with == ()


@pytest.mark.parametrize(
    ("low", "value", "first", "adopted"),
    [
        (2.0, 20.0, False, True),  # significantly likelier
        (-1.0, 20.0, False, False),  # not significantly
        (-1.0, 20.0, True, True),  # odds of e²⁰ suffice for a first cause
        (-1.0, 2.0, True, False),  # e² do not: 7 to one
    ],
)
def test_a_cause_is_adopted_if_held_out_data_confirm_it(
    low: float, value: float, first: bool, adopted: bool
) -> None:
    gain = gained(value, low)
    choice = cast(Any, SimpleNamespace(score=SUFFICIENT - 1))
    assert pays_enough(choice, gain, first=first) is adopted


@pytest.mark.parametrize(("score", "adopted"), [(SUFFICIENT - 1, False), (SUFFICIENT, True)])
def test_a_further_cause_with_a_large_score_is_adopted(score: float, adopted: bool) -> None:
    choice = cast(Any, SimpleNamespace(score=score))
    assert pays_enough(choice, gained(20.0, -1.0), first=False) is adopted


@pytest.mark.parametrize(
    ("value", "less_deg", "adopted"),
    [
        (24.6, 0.011, True),  # a dead zone's 25 in the few cells where the voltage came near it
        (24.6, -0.002, False),  # no axis is predicted significantly better
        (11.0, 0.011, False),  # odds of 6·10⁴ to one only
    ],
)
def test_a_brief_effect_pays_by_its_odds_and_one_better_predicted_axis(
    value: float, less_deg: float, adopted: bool
) -> None:
    choice = cast(Any, SimpleNamespace(score=40.0))
    assert pays_enough(choice, gained(value, -7.0, less_deg), first=False) is adopted


def found_with(rho: float) -> Any:
    free = [SimpleNamespace(term=None), SimpleNamespace(term=DRAG)]
    return SimpleNamespace(free=free, colour=[9.0, rho])


def test_coloured_noise_lowers_a_cause_s_margin_over_the_threshold() -> None:
    drag = replace(choice(176.0, (), drag__quadratic__yaw=176.0), Z2=60.0, threshold=20.0)
    assert coloured_noise_margin(found_with(1.5), drag) == pytest.approx(2.0)
    assert coloured_noise_margin(found_with(6.0), drag) == pytest.approx(0.5)
    assert coloured_noise_margin(found_with(1.0), drag) == float("inf")


def test_the_confidence_in_a_cause_is_at_most_that_in_its_size() -> None:
    """5.3 ± 2.9 is 1.83 standard deviations from zero: 97 %, however likely the cause."""
    free = SimpleNamespace(term="stiffness.pendulum.roll", log=False, null=0.0)
    fit = cast(Any, SimpleNamespace(free=[free], values=np.array([5.3]), std=np.array([2.9])))
    assert size_confidence(fit, "stiffness.pendulum.roll") == pytest.approx(0.966, abs=0.001)
    assert size_confidence(fit, "motor.saturation") == 1.0
