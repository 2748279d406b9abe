"""The trim torque with the mean of the torques that differ by recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis.base_parameters import base_parameters, off_nominal
from heli3dof.diagnosis.free_run.mean_trim import MeanTrimFit
from heli3dof.identification.greybox.freeflight import REAL_TERMS, problem_of
from heli3dof.identification.greybox.multistep import MultiStepFit
from tests.identification.known_flights import fly

WEIGHT = "mass.imbalance.torque_Nm"


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
