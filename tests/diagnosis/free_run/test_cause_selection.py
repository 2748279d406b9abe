"""Which terms are causes and which are only kept: the rules, on a synthetic fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis.base_parameters import base_parameters, off_nominal
from heli3dof.diagnosis.free_run.cause_selection import (
    MeanTrimFit,
    NullDistance,
    both_significant,
    confidence,
    contradicted,
    equivalent_deviation,
    estimates_agree,
    kept_terms,
    not_identifiable,
    probability_nonzero,
    select_causes,
    sizes,
)
from heli3dof.diagnosis.free_run.elimination import (
    Elimination,
    LossIncrease,
    TermResult,
)
from heli3dof.diagnosis.free_run.refits import FitWithFolds
from heli3dof.identification.greybox.freeflight import REAL_TERMS, problem_of
from heli3dof.identification.greybox.multistep import MultiStepFit
from tests.identification.known_flights import fly

WEIGHT = "mass.imbalance.torque_Nm"
NEEDED = LossIncrease(2.0, 0.5, 3.0, 0.5, 0.99)
NOT_NEEDED = LossIncrease(0.1, -0.5, 0.7, 0.3, 0.6)
YAW, PITCH = "friction.coulomb.yaw", "friction.coulomb.pitch"


@pytest.fixture(scope="module")
def flat() -> MultiStepFit:
    """Return a fit to data without information: every parameter has its prior mean and σ."""
    p = problem_of([fly(1022, until_s=40.0).recording.between(0, 25)], REAL_TERMS)
    return MultiStepFit(
        p, p.start.copy(), np.ones(4), np.ones((7, 3)), 0.0, np.zeros((p.dim, 1)), 0, True
    )


def determined(fit: MultiStepFit, values: dict[str, float], std: float) -> MultiStepFit:
    """Return the fit with these parameters at ``values`` ± ``std``, the others unchanged."""
    z, rows = fit.z.copy(), np.zeros((fit.problem.dim, fit.problem.dim))
    for name, value in values.items():
        j = fit.structure.names.index(name)
        f = fit.structure.free[j]
        z[j] = f.scaled(value)
        rows[j, j] = f.slope(value) / std
    return replace(fit, z=z, tangents=rows)


def elimination_of(
    fit: MultiStepFit, kept: dict[str, LossIncrease], gone: dict[str, LossIncrease]
) -> Elimination:
    without_folds = FitWithFolds(fit, ())
    return Elimination(
        fit,
        tuple(TermResult(t, w) for t, w in kept.items()),
        tuple(TermResult(t, w) for t, w in gone.items()),
        without_folds,
        without_folds,
    )


def with_halves(result: Elimination, *halves: MultiStepFit) -> Elimination:
    return replace(result, first=FitWithFolds(result.fit, halves))


def test_a_size_of_1_96_deviations_differs_from_zero_at_95_percent(flat: MultiStepFit) -> None:
    fit = determined(flat, {f"{YAW}.torque_Nm": 1.96e-3}, 1e-3)
    assert probability_nonzero(fit, YAW) == pytest.approx(0.95, abs=0.001)


def test_an_offset_per_recording_is_tested_by_its_values(flat: MultiStepFit) -> None:
    """One recording's offset is 5° ± 1°, so five deviations from zero."""
    assert probability_nonzero(flat, "encoder.offset.pitch") == pytest.approx(0.0, abs=1e-6)
    fit = determined(flat, {}, 1.0)
    j = fit.structure.names.index("encoder.offset.pitch.angle_deg")
    f, at = fit.structure.free[j], fit.problem.n
    z, rows = fit.z.copy(), fit.tangents.copy()
    z[at] = f.scaled(5.0)
    rows[at, at] = f.slope(5.0)
    fit = replace(fit, z=z, tangents=rows)
    assert probability_nonzero(fit, "encoder.offset.pitch") > 0.99999


def test_a_cause_is_needed_by_blocks_and_has_a_significant_size(flat: MultiStepFit) -> None:
    fit = determined(flat, {f"{YAW}.torque_Nm": 0.03, f"{PITCH}.torque_Nm": 0.001}, 2e-3)
    causes, kept = select_causes(elimination_of(fit, {YAW: NEEDED, PITCH: NEEDED}, {}))
    assert [r.term for r in causes] == [YAW]
    assert [r.term for r in kept] == [PITCH]


def test_a_term_without_significance_in_one_half_is_only_kept(flat: MultiStepFit) -> None:
    fit = determined(flat, {f"{YAW}.torque_Nm": 0.03}, 2e-3)
    significant, insignificant = fit, determined(flat, {f"{YAW}.torque_Nm": 0.001}, 2e-3)
    result = elimination_of(fit, {YAW: NEEDED}, {})
    assert select_causes(with_halves(result, significant, significant))[0]
    doubted = with_halves(result, significant, insignificant)
    causes, kept = select_causes(doubted)
    assert not causes
    assert "different sizes" in contradicted(doubted, kept[0])
    assert "different sizes" in kept_terms(doubted, kept)[0]["why"]


def test_a_term_that_blocks_do_not_need_is_kept_with_its_reason(flat: MultiStepFit) -> None:
    fit = determined(flat, {f"{YAW}.torque_Nm": 0.03, f"{PITCH}.torque_Nm": 0.001}, 2e-3)
    result = with_halves(elimination_of(fit, {PITCH: NEEDED}, {YAW: NOT_NEEDED}), fit, fit)
    causes, kept = select_causes(result)
    assert not causes
    reasons = {x["term"]: x["why"] for x in kept_terms(result, kept)}
    assert "do not need" in reasons[YAW]
    assert "not significant" in reasons[PITCH]


def test_a_kept_weight_is_reported_with_one_value_per_recording(flat: MultiStepFit) -> None:
    result = elimination_of(flat, {}, {"mass.imbalance": NOT_NEEDED, YAW: NOT_NEEDED})
    weight, friction = kept_terms(result, list(result.removed))
    assert weight["why"].startswith("with one value per recording")
    assert not friction["why"].startswith("with")


def test_confidence_is_the_lesser_probability_and_known_terms_need_no_blocks(
    flat: MultiStepFit,
) -> None:
    fit = determined(flat, {f"{YAW}.torque_Nm": 0.03, "motor.rotor_curve.exponent": 1.8}, 2e-3)
    result = elimination_of(fit, {YAW: NEEDED, "motor.rotor_curve": NOT_NEEDED}, {})
    assert confidence(result, result.needed[0]) == pytest.approx(0.99)
    assert confidence(result, result.needed[1]) > 0.99


def test_a_size_is_listed_with_its_prior(flat: MultiStepFit) -> None:
    size = sizes(flat, YAW)["torque_Nm"]
    assert size["prior_mean"] == pytest.approx(0.0)
    assert size["prior_std"] == size["std"] == pytest.approx(0.05)


def test_terms_without_information_are_not_identifiable(flat: MultiStepFit) -> None:
    fit = determined(flat, {f"{YAW}.torque_Nm": 0.03}, 2e-3)
    assert YAW in set(not_identifiable(flat, []))
    assert YAW not in set(not_identifiable(fit, []))
    assert "friction.viscous.yaw" in set(not_identifiable(fit, []))


def test_a_prior_far_from_the_null_value_is_not_a_cause(flat: MultiStepFit) -> None:
    """rotor_curve: prior 2.0 ± 0.2, null value 1.0, so five deviations without any data."""
    curve = "motor.rotor_curve"
    assert probability_nonzero(flat, curve) > 0.99
    causes, kept = select_causes(elimination_of(flat, {curve: NEEDED}, {}))
    assert causes == []
    assert [r.term for r in kept] == [curve]
    assert "prior" in kept_terms(elimination_of(flat, {curve: NEEDED}, {}), kept)[0]["why"]


def significant(u: float, other: float, mostly_prior: bool = False) -> bool:
    """Whether two estimates that are u and ``other`` standard deviations from zero both count."""
    one = NullDistance(u, (u, 1.0), mostly_prior)
    return both_significant(one, NullDistance(other, (other, 1.0)))


def test_both_halves_must_have_the_same_sign() -> None:
    assert significant(3.0, 2.0)
    assert not significant(3.0, -2.0)


def test_one_half_without_significance_is_not_enough() -> None:
    assert not significant(9.0, 1.0)


def test_an_estimate_from_the_prior_alone_does_not_count() -> None:
    assert not significant(5.0, 5.0, mostly_prior=True)


def test_sizes_that_differ_by_more_than_three_deviations_are_inconsistent() -> None:
    one = NullDistance(9.0, (9.0, 1.0))
    assert estimates_agree(one, NullDistance(5.0, (9.0 - 2.9 * 2**0.5, 1.0)))
    assert not estimates_agree(one, NullDistance(5.0, (9.0 - 3.1 * 2**0.5, 1.0)))


def test_a_parameter_that_varies_by_recording_has_no_size_to_compare() -> None:
    pair = NullDistance(9.0, None), NullDistance(3.0, None)
    assert estimates_agree(*pair)
    assert both_significant(*pair)


@pytest.mark.parametrize(
    ("chi2", "freedom", "deviations"), [(4.0, 1, 2.0), (0.0, 1, 0.0), (5.991, 2, 1.960)]
)
def test_a_chi_square_converts_to_equally_rare_deviations(
    chi2: float, freedom: int, deviations: float
) -> None:
    """χ² of one number is its square; for two numbers, 5 % lie above 5.991."""
    assert equivalent_deviation(chi2, freedom) == pytest.approx(deviations, abs=1e-3)


@pytest.fixture(scope="module")
def known() -> MultiStepFit:
    """A fit at the prior means, with σ = 0.02 in each coordinate."""
    p = problem_of([fly(1022, until_s=40.0).recording.between(0, 25)], REAL_TERMS)
    D = np.eye(p.dim) / 0.02
    return MultiStepFit(p, p.start.copy(), np.ones(4), np.ones((7, 3)), 0.0, D, 0, True)


def changed(fit: MultiStepFit, **ratios: float) -> MultiStepFit:
    """The fit with base parameters multiplied by these ratios."""
    z = fit.z.copy()
    for name, ratio in ratios.items():
        j = fit.structure.names.index(name)
        f = fit.structure.free[j]
        z[j] = f.scaled(ratio * f.unscaled(z[j]))
    return replace(fit, z=z)


def test_the_mean_of_the_recordings_counts_with_the_trim_torque(known: MultiStepFit) -> None:
    j = known.structure.names.index(WEIGHT)
    p, z = known.problem, known.z.copy()
    z[p.n + list(p.own).index(j)] += known.structure.free[j].scaled(0.1)
    more = MeanTrimFit(replace(known, z=z)).values - MeanTrimFit(known).values
    assert more[0] == pytest.approx(0.1)
    assert more[1:] == pytest.approx(np.zeros(len(more) - 1))


def test_a_torque_that_the_mean_takes_from_the_trim_torque_adds_no_uncertainty(
    known: MultiStepFit,
) -> None:
    """Var(T_g + τ̄) = Var T_g + Var τ̄ + 2 Cov, zero if one is the other's opposite."""
    C = known.covariance
    j = known.structure.names.index(WEIGHT)
    assert MeanTrimFit(known).std[0] ** 2 == pytest.approx(C[0, 0] + C[j, j] + 2 * C[0, j])


def test_a_heavier_arm_is_a_mass_imbalance(known: MultiStepFit) -> None:
    (found,) = off_nominal(MeanTrimFit(changed(known, T_g=1.6)))
    assert found.term.name == "mass.imbalance"


def test_three_inertias_off_by_one_factor_are_one_thrust_gain(known: MultiStepFit) -> None:
    fit = MeanTrimFit(changed(known, T_g=0.6, J_roll=0.6, J_pitch=0.6, J_yaw=0.6))
    assert [o.term.name for o in off_nominal(fit)] == ["motor.thrust_gain"]
    K_f, *others = base_parameters(fit)
    assert K_f.value / K_f.nominal == pytest.approx(1 / 0.6, rel=0.1)
    assert all(c.value / c.nominal == pytest.approx(1.0, abs=0.1) for c in others)


def test_a_rig_within_its_profile_has_no_finding(known: MultiStepFit) -> None:
    assert off_nominal(MeanTrimFit(known)) == ()
