"""Causes are adopted for their gain on held-out data; adopted causes are not confounded."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.conclusion import adoption
from heli3dof.diagnosis.conclusion.adoption import (
    adopted,
    is_coloured_noise,
    meets_adoption_condition,
    size_confidence,
    within_a_count,
    without_mutual_ties,
    worsens,
)
from heli3dof.diagnosis.constants import SUFFICIENT
from heli3dof.diagnosis.result import DOES_NOT_PAY, WITHIN_A_COUNT
from heli3dof.diagnosis.search.candidate_fits import CandidateFit
from heli3dof.diagnosis.search.select import Choice
from heli3dof.diagnosis.validation.gain import Interval
from heli3dof.model.effects import terms
from heli3dof.rig.profile import default_profile

NONE = cast(Any, None)


def choice(score: float, tied: tuple[str, ...], **others: float) -> Choice:
    """Choice among effects by name (``__`` for a dot) and score; the first is the cause."""
    fits = tuple(
        CandidateFit(terms([n.replace("__", ".")])[0], NONE, NONE, s, s, 0)
        for n, s in others.items()
    )
    return Choice(fits[0].term, score, 0.5, tied, fits)


def gained(value: float, low: float, less_deg: float = -0.001) -> Any:
    """Gain in log-likelihood, and in degrees on roll by at least ``less_deg``."""
    rmse = {"roll": Interval(0.03, less_deg, 0.05), "pitch": None, "yaw": None}
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
    assert meets_adoption_condition(choice, gain, first=first) is adopted


@pytest.mark.parametrize(("score", "adopted"), [(SUFFICIENT - 1, False), (SUFFICIENT, True)])
def test_a_further_cause_with_a_large_score_is_adopted(score: float, adopted: bool) -> None:
    choice = cast(Any, SimpleNamespace(score=score))
    assert meets_adoption_condition(choice, gained(20.0, -1.0), first=False) is adopted


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
    assert meets_adoption_condition(choice, gained(value, -7.0, less_deg), first=False) is adopted


def found_with(rho: float) -> Any:
    free = [SimpleNamespace(term=None), SimpleNamespace(term=DRAG)]
    return SimpleNamespace(free=free, coloured_noise_factor=[9.0, rho])


def test_coloured_noise_lowers_a_cause_s_squared_score() -> None:
    drag = replace(choice(60.0, (), drag__quadratic__yaw=60.0), threshold=20.0)
    assert not is_coloured_noise(found_with(1.5), NONE, drag, seed=0)  # 60/1.5 = 40 > 20
    assert is_coloured_noise(found_with(6.0), NONE, drag, seed=0)
    assert not is_coloured_noise(found_with(1.0), NONE, drag, seed=0)


@pytest.mark.parametrize(("margin", "is_noise"), [(0.9, True), (1.1, False)])
def test_a_change_of_mass_must_be_a_larger_step_than_coloured_noise_has(
    monkeypatch: pytest.MonkeyPatch, margin: float, is_noise: bool
) -> None:
    monkeypatch.setattr(adoption, "step_margin", lambda fit, axis, *, seed: margin)
    mass = choice(1443.0, (), mass__change=1443.0)
    assert is_coloured_noise(NONE, NONE, mass, seed=0) == is_noise


OFFSET, BACKLASH, MASS = "encoder.offset.pitch", "encoder.backlash.pitch", "mass.change"


def encoder_of(size_deg: float, tied: tuple[str, ...], first: str, of: str = OFFSET) -> Choice:
    """Choice of ``first``, with a pitch encoder error of that size."""
    encoder = SimpleNamespace(roll=4096, pitch=-4096, yaw=8192)
    problem = SimpleNamespace(
        values=lambda theta: theta,
        structure=SimpleNamespace(profile=SimpleNamespace(encoder=encoder)),
    )
    optimum = SimpleNamespace(theta=[1.17, size_deg])
    own = CandidateFit(terms([of])[0], cast(Any, problem), cast(Any, optimum), 90.0, 90.0, 0)
    other = CandidateFit(terms([first])[0], NONE, NONE, 95.0, 95.0, 0)
    fits = (own,) if first == of else (other, own)
    return Choice(fits[0].term, 95.0, 1.0, tied, fits)


def fit_of(**sizes: float) -> Any:
    """A fit of these terms (``__`` for a dot) with these first parameters, and simulations."""
    names = [n.replace("__", ".") for n in sizes]
    return SimpleNamespace(
        free=[SimpleNamespace(term=n) for n in names], values=[*sizes.values()],
        coloured_noise_factor=[1.0] * len(names), is_corrected=True,
        structure=SimpleNamespace(profile=default_profile()),
    )  # fmt: skip


def within(size_deg: float, tied: tuple[str, ...], first: str, of: str = OFFSET) -> bool:
    """Test a cause with the same size in the last fit as when it was selected."""
    fit = fit_of(**{first: size_deg if first == of else 0.02})
    return within_a_count(fit, encoder_of(size_deg, tied, first, of))


def test_an_encoder_error_within_one_count_is_not_a_cause() -> None:
    # A count on pitch is 360°/4096 = 0.088°.
    assert within(-0.05, (), OFFSET)
    assert not within(-0.1, (), OFFSET)
    assert within(0.05, (OFFSET,), "aero.reaction_torque")
    assert within(0.05, (), BACKLASH, BACKLASH)
    assert not within(0.1, (), BACKLASH, BACKLASH)
    # A torque that is confounded with so little backlash may still be a torque.
    assert not within(0.05, (BACKLASH,), "aero.reaction_torque", BACKLASH)
    # If the flight separates the two, the finding is not the encoder's.
    assert not within(0.05, (), "aero.reaction_torque")


@pytest.mark.parametrize(
    ("roll", "pitch", "worse"),
    [
        ((-0.8, -1.0, -0.5), None, True),
        ((-0.02, -0.03, -0.01), None, False),  # less than rounding: 360°/4096/√12 = 0.025°
        ((-0.8, -1.8, 0.2), None, False),  # not significant
        ((-0.8, -1.0, -0.5), (0.3, 0.1, 0.5), False),  # pitch is predicted better
    ],
)
def test_a_cause_must_not_worsen_predictions(
    roll: tuple[float, ...], pitch: tuple[float, ...] | None, worse: bool
) -> None:
    rmse = {"roll": Interval(*roll), "pitch": pitch and Interval(*pitch), "yaw": None}
    g: Any = SimpleNamespace(rmse_deg=rmse)
    assert worsens(g, default_profile()) == worse


def test_the_final_fit_determines_the_size() -> None:
    taken = encoder_of(0.5, (), BACKLASH, BACKLASH)
    assert within_a_count(fit_of(encoder__backlash__pitch=0.017), taken)
    assert not within_a_count(fit_of(encoder__backlash__pitch=0.5), taken)


@pytest.mark.parametrize(
    ("mass_pays", "named"),
    [
        (True, [BACKLASH, MASS]),
        (False, []),  # without it the backlash is 0.017°, a fifth of a count
    ],
)
def test_backlash_that_shrinks_below_a_count_without_another_cause_is_dropped(
    monkeypatch: pytest.MonkeyPatch, mass_pays: bool, named: list[str]
) -> None:
    def without(fit: Any, name: str) -> Any:
        rest = {f.term for f in fit.free} - {name}
        size = 0.5 if MASS in rest else 0.017
        return fit_of(**{n: size if n == BACKLASH else 0.015 for n in sorted(rest)})

    def gain(before: Any, after: Any, *, seed: int) -> Any:
        (added,) = {f.term for f in after.free} - {f.term for f in before.free}
        return gained(*((40.0, 20.0) if added == BACKLASH or mass_pays else (-389.0, -2726.0)))

    monkeypatch.setattr(adoption, "held_out", lambda fit, holdout: fit)
    monkeypatch.setattr(adoption, "without", without)
    monkeypatch.setattr(adoption, "gain", gain)
    monkeypatch.setattr(adoption, "step_margin", lambda fit, axis, *, seed: 9.0)
    monkeypatch.setattr(adoption, "_findings", lambda fit, kept, less, gains: tuple(kept))
    backlash = encoder_of(0.5, (), BACKLASH, BACKLASH)
    both = fit_of(encoder__backlash__pitch=0.5, mass__change=0.015)
    result = adopted(both, [backlash, choice(1443.0, (), mass__change=1443.0)], [], seed=0)
    assert [c.term.name for c in result.findings] == named
    assert [(d.name, d.why) for d in result.dropped] == (
        [] if named else [(MASS, DOES_NOT_PAY), (BACKLASH, WITHIN_A_COUNT)]
    )


def test_the_confidence_in_a_cause_is_at_most_that_in_its_size() -> None:
    """5.3 ± 2.9 is 1.83 standard deviations from zero: 97 %, however likely the cause."""
    free = SimpleNamespace(term="stiffness.pendulum.roll", log=False, null=0.0)
    fit = cast(Any, SimpleNamespace(free=[free], values=np.array([5.3]), std=np.array([2.9])))
    assert size_confidence(fit, "stiffness.pendulum.roll") == pytest.approx(0.966, abs=0.001)
    assert size_confidence(fit, "motor.saturation") == 1.0
