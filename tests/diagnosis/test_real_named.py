"""Which terms are named and which are only kept: the arithmetic, on a fit made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis.backward import Backward, Removal, Worse
from heli3dof.diagnosis.real_named import (
    apart,
    certainty,
    contradicted,
    named,
    sizes,
    unseen,
    within,
)
from heli3dof.identification.greybox.freeflight import REAL_TERMS, problem_of
from heli3dof.identification.greybox.multistep import Fitted
from tests.identification.known_flights import fly

NEEDED = Worse(2.0, 0.5, 3.0, 0.5, 0.99)
NOT_NEEDED = Worse(0.1, -0.5, 0.7, 0.3, 0.6)
YAW, PITCH = "friction.coulomb.yaw", "friction.coulomb.pitch"


@pytest.fixture(scope="module")
def flat() -> Fitted:
    """Data that say nothing: every number at its prior, with the prior's deviation."""
    p = problem_of([fly(1022).recording.between(0, 25)], REAL_TERMS)
    return Fitted(
        p, p.start.copy(), np.ones(4), np.ones((7, 3)), 0.0, np.zeros((p.dim, 1)), 0, True
    )


def told(fit: Fitted, values: dict[str, float], std: float) -> Fitted:
    """The same where data tell those numbers to ``std``, all others not."""
    z, rows = fit.z.copy(), np.zeros((fit.problem.dim, fit.problem.dim))
    for name, value in values.items():
        j = fit.structure.names.index(name)
        f = fit.structure.free[j]
        z[j] = f.inward(value)
        rows[j, j] = f.slope(value) / std
    return replace(fit, z=z, tangents=rows)


def backward_of(fit: Fitted, kept: dict[str, Worse], gone: dict[str, Worse]) -> Backward:
    return Backward(
        fit,
        fit,
        tuple(Removal(t, w) for t, w in kept.items()),
        tuple(Removal(t, w) for t, w in gone.items()),
    )


def test_a_size_of_1_96_deviations_is_95_percent_sure_to_be_one(flat: Fitted) -> None:
    fit = told(flat, {f"{YAW}.torque_Nm": 1.96e-3}, 1e-3)
    assert apart(fit, YAW) == pytest.approx(0.95, abs=0.001)


def test_a_zero_that_may_differ_by_recording_is_told_from_none_by_its_values(flat: Fitted) -> None:
    """One recording whose own zero is 5° ± 1°: five deviations, and none where nothing is said."""
    assert apart(flat, "encoder.offset.pitch") == pytest.approx(0.0, abs=1e-6)
    fit = told(flat, {}, 1.0)
    j = fit.structure.names.index("encoder.offset.pitch.angle_deg")
    f, at = fit.structure.free[j], fit.problem.n
    z, rows = fit.z.copy(), fit.tangents.copy()
    z[at] = f.inward(5.0)
    rows[at, at] = f.slope(5.0)
    fit = replace(fit, z=z, tangents=rows)
    assert apart(fit, "encoder.offset.pitch") > 0.99999


def test_a_cause_is_needed_by_blocks_and_has_a_size_that_is_sure(flat: Fitted) -> None:
    fit = told(flat, {f"{YAW}.torque_Nm": 0.03, f"{PITCH}.torque_Nm": 0.001}, 2e-3)
    causes, kept = named(backward_of(fit, {YAW: NEEDED, PITCH: NEEDED}, {}))
    assert [r.term for r in causes] == [YAW]
    assert [r.term for r in kept] == [PITCH]


def test_what_one_half_of_the_flights_does_not_show_is_no_cause(flat: Fitted) -> None:
    fit = told(flat, {f"{YAW}.torque_Nm": 0.03}, 2e-3)
    shows, shows_not = fit, told(flat, {f"{YAW}.torque_Nm": 0.001}, 2e-3)
    found = backward_of(fit, {YAW: NEEDED}, {})
    assert named(replace(found, halves=(shows, shows)))[0]
    doubted = replace(found, halves=(shows, shows_not))
    causes, kept = named(doubted)
    assert not causes
    assert "different sizes" in contradicted(doubted, kept[0])
    assert "different sizes" in within(doubted, kept)[0]["why"]


def test_what_blocks_do_not_need_is_no_cause_but_stays_with_its_reason(flat: Fitted) -> None:
    fit = told(flat, {f"{YAW}.torque_Nm": 0.03, f"{PITCH}.torque_Nm": 0.001}, 2e-3)
    found = replace(backward_of(fit, {PITCH: NEEDED}, {YAW: NOT_NEEDED}), halves=(fit, fit))
    causes, kept = named(found)
    assert not causes
    said = {x["term"]: x["why"] for x in within(found, kept)}
    assert "do not need" in said[YAW]
    assert "not significant" in said[PITCH]


def test_a_weight_that_is_kept_is_kept_as_what_differs_by_recording(flat: Fitted) -> None:
    found = backward_of(flat, {}, {"mass.imbalance": NOT_NEEDED, YAW: NOT_NEEDED})
    weight, friction = within(found, list(found.gone))
    assert weight["why"].startswith("with one value per recording")
    assert not friction["why"].startswith("with")


def test_certainty_is_the_lesser_of_size_and_need_and_what_is_known_needs_no_blocks(
    flat: Fitted,
) -> None:
    fit = told(flat, {f"{YAW}.torque_Nm": 0.03, "motor.rotor_curve.exponent": 1.8}, 2e-3)
    found = backward_of(fit, {YAW: NEEDED, "motor.rotor_curve": NOT_NEEDED}, {})
    assert certainty(found, found.kept[0]) == pytest.approx(0.99)
    assert certainty(found, found.kept[1]) > 0.99


def test_a_size_stands_beside_what_was_known_of_it(flat: Fitted) -> None:
    size = sizes(flat, YAW)["torque_Nm"]
    assert size["prior_mean"] == pytest.approx(0.0)
    assert size["prior_std"] == size["std"] == pytest.approx(0.05)


def test_recordings_that_say_nothing_show_nothing_and_what_they_tell_is_seen(flat: Fitted) -> None:
    fit = told(flat, {f"{YAW}.torque_Nm": 0.03}, 2e-3)
    assert YAW in set(unseen(flat, []))
    assert YAW not in set(unseen(fit, []))
    assert "friction.viscous.yaw" in set(unseen(fit, []))
