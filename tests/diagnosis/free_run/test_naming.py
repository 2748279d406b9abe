"""Which terms are causes and which are only kept: the arithmetic, on a fit made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis.free_run.elimination import Elimination, Removal, Worse
from heli3dof.diagnosis.free_run.naming import (
    apart,
    certainty,
    contradicted,
    named,
    sizes,
    unseen,
    within,
)
from heli3dof.identification.greybox.freeflight import REAL_TERMS, problem_of
from heli3dof.identification.greybox.multistep import MultiStepFit
from tests.identification.known_flights import fly

NEEDED = Worse(2.0, 0.5, 3.0, 0.5, 0.99)
NOT_NEEDED = Worse(0.1, -0.5, 0.7, 0.3, 0.6)
YAW, PITCH = "friction.coulomb.yaw", "friction.coulomb.pitch"


@pytest.fixture(scope="module")
def flat() -> MultiStepFit:
    """No information in the data: every parameter at its prior, with the prior's deviation."""
    p = problem_of([fly(1022).recording.between(0, 25)], REAL_TERMS)
    return MultiStepFit(
        p, p.start.copy(), np.ones(4), np.ones((7, 3)), 0.0, np.zeros((p.dim, 1)), 0, True
    )


def determined(fit: MultiStepFit, values: dict[str, float], std: float) -> MultiStepFit:
    """The same fit with these parameters determined to ``std`` and no others."""
    z, rows = fit.z.copy(), np.zeros((fit.problem.dim, fit.problem.dim))
    for name, value in values.items():
        j = fit.structure.names.index(name)
        f = fit.structure.free[j]
        z[j] = f.inward(value)
        rows[j, j] = f.slope(value) / std
    return replace(fit, z=z, tangents=rows)


def backward_of(fit: MultiStepFit, kept: dict[str, Worse], gone: dict[str, Worse]) -> Elimination:
    return Elimination(
        fit,
        fit,
        tuple(Removal(t, w) for t, w in kept.items()),
        tuple(Removal(t, w) for t, w in gone.items()),
    )


def test_a_size_of_1_96_deviations_differs_from_zero_at_95_percent(flat: MultiStepFit) -> None:
    fit = determined(flat, {f"{YAW}.torque_Nm": 1.96e-3}, 1e-3)
    assert apart(fit, YAW) == pytest.approx(0.95, abs=0.001)


def test_an_offset_per_recording_is_tested_by_its_values(flat: MultiStepFit) -> None:
    """One recording with its own offset of 5° ± 1°: five deviations; zero without data."""
    assert apart(flat, "encoder.offset.pitch") == pytest.approx(0.0, abs=1e-6)
    fit = determined(flat, {}, 1.0)
    j = fit.structure.names.index("encoder.offset.pitch.angle_deg")
    f, at = fit.structure.free[j], fit.problem.n
    z, rows = fit.z.copy(), fit.tangents.copy()
    z[at] = f.inward(5.0)
    rows[at, at] = f.slope(5.0)
    fit = replace(fit, z=z, tangents=rows)
    assert apart(fit, "encoder.offset.pitch") > 0.99999


def test_a_cause_is_needed_by_blocks_and_has_a_significant_size(flat: MultiStepFit) -> None:
    fit = determined(flat, {f"{YAW}.torque_Nm": 0.03, f"{PITCH}.torque_Nm": 0.001}, 2e-3)
    causes, kept = named(backward_of(fit, {YAW: NEEDED, PITCH: NEEDED}, {}))
    assert [r.term for r in causes] == [YAW]
    assert [r.term for r in kept] == [PITCH]


def test_a_term_that_one_half_does_not_show_is_only_kept(flat: MultiStepFit) -> None:
    fit = determined(flat, {f"{YAW}.torque_Nm": 0.03}, 2e-3)
    shows, shows_not = fit, determined(flat, {f"{YAW}.torque_Nm": 0.001}, 2e-3)
    result = backward_of(fit, {YAW: NEEDED}, {})
    assert named(replace(result, halves=(shows, shows)))[0]
    doubted = replace(result, halves=(shows, shows_not))
    causes, kept = named(doubted)
    assert not causes
    assert "different sizes" in contradicted(doubted, kept[0])
    assert "different sizes" in within(doubted, kept)[0]["why"]


def test_a_term_that_blocks_do_not_need_is_kept_with_its_reason(flat: MultiStepFit) -> None:
    fit = determined(flat, {f"{YAW}.torque_Nm": 0.03, f"{PITCH}.torque_Nm": 0.001}, 2e-3)
    result = replace(backward_of(fit, {PITCH: NEEDED}, {YAW: NOT_NEEDED}), halves=(fit, fit))
    causes, kept = named(result)
    assert not causes
    reasons = {x["term"]: x["why"] for x in within(result, kept)}
    assert "do not need" in reasons[YAW]
    assert "not significant" in reasons[PITCH]


def test_a_kept_weight_is_reported_with_one_value_per_recording(flat: MultiStepFit) -> None:
    result = backward_of(flat, {}, {"mass.imbalance": NOT_NEEDED, YAW: NOT_NEEDED})
    weight, friction = within(result, list(result.gone))
    assert weight["why"].startswith("with one value per recording")
    assert not friction["why"].startswith("with")


def test_certainty_is_the_lesser_of_size_and_need_and_known_terms_need_no_blocks(
    flat: MultiStepFit,
) -> None:
    fit = determined(flat, {f"{YAW}.torque_Nm": 0.03, "motor.rotor_curve.exponent": 1.8}, 2e-3)
    result = backward_of(fit, {YAW: NEEDED, "motor.rotor_curve": NOT_NEEDED}, {})
    assert certainty(result, result.kept[0]) == pytest.approx(0.99)
    assert certainty(result, result.kept[1]) > 0.99


def test_a_size_is_listed_with_its_prior(flat: MultiStepFit) -> None:
    size = sizes(flat, YAW)["torque_Nm"]
    assert size["prior_mean"] == pytest.approx(0.0)
    assert size["prior_std"] == size["std"] == pytest.approx(0.05)


def test_terms_without_information_are_unseen(flat: MultiStepFit) -> None:
    fit = determined(flat, {f"{YAW}.torque_Nm": 0.03}, 2e-3)
    assert YAW in set(unseen(flat, []))
    assert YAW not in set(unseen(fit, []))
    assert "friction.viscous.yaw" in set(unseen(fit, []))


def test_a_prior_far_from_absence_names_no_cause(flat: MultiStepFit) -> None:
    """rotor_curve: prior 2.0 ± 0.2, absence at 1.0: five deviations without any data."""
    curve = "motor.rotor_curve"
    assert apart(flat, curve) > 0.99
    causes, kept = named(backward_of(flat, {curve: NEEDED}, {}))
    assert causes == []
    assert [r.term for r in kept] == [curve]
    assert "prior" in within(backward_of(flat, {curve: NEEDED}, {}), kept)[0]["why"]
