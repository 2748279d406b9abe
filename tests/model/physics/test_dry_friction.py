"""Dry friction sticks, slips, stops; and what it does to a rate that is known only roughly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate
from scipy.stats import norm

from heli3dof.model.greybox.linearisation import _Plant
from heli3dof.model.greybox.model import nominal
from heli3dof.model.physics.dry_friction import (
    apply_dry_friction,
    apply_friction_to_covariance,
    soft_threshold,
)
from heli3dof.rig.profile import default_profile
from tests.model.simulation_step import stepped

PROFILE = default_profile()
J_yaw = 0.950809  # kg·m², the profile's point masses
HOVER = np.full(2, PROFILE.motor.V_o)
DT = 0.002


def yaw_rates(terms: dict[str, float], rate: float, seconds: float) -> np.ndarray:
    """(N, 2) yaw angle and rate of a rig that hovers level, let go at this yaw rate."""
    names = tuple(n.rpartition(".")[0] for n in terms)
    plant = _Plant(nominal(PROFILE, names, **terms))
    z = np.zeros(8)
    z[5] = rate
    out = []
    for _ in range(round(seconds / DT)):
        z = stepped(plant, z, HOVER, DT)
        out.append((z[2], z[5]))
    return np.array(out)


def test_a_joint_under_less_than_its_friction_does_not_move_at_all() -> None:
    terms = {"friction.coulomb.yaw.torque_Nm": 0.03, "bias.torque.yaw.torque_Nm": 0.02}
    path = yaw_rates(terms, 0.0, 2.0)
    assert not path[:, 1].any()
    assert np.abs(path[:, 0]).max() < 1e-15  # rounding


def test_a_joint_under_more_accelerates_by_the_difference() -> None:
    terms = {"friction.coulomb.yaw.torque_Nm": 0.01, "bias.torque.yaw.torque_Nm": 0.03}
    rate = yaw_rates(terms, 0.0, 1.0)[-1, 1]
    assert rate == pytest.approx(0.02 / J_yaw * 1.0, rel=1e-3)


def test_a_coasting_joint_stops_after_its_momentum_over_the_friction_and_stays() -> None:
    # 0.1 rad/s · 0.950809 kg·m² / 0.05 N·m = 1.9016 s; way: ½ · 0.1 · 1.9016 = 0.09508 rad
    path = yaw_rates({"friction.coulomb.yaw.torque_Nm": 0.05}, 0.1, 3.0)
    stopped = int(np.argmax(path[:, 1] == 0.0))
    assert stopped * DT == pytest.approx(1.9016, abs=2 * DT)
    assert path[-1, 0] == pytest.approx(0.09508, rel=2e-3)
    assert not path[stopped:, 1].any()


@settings(max_examples=60, deadline=None)
@given(st.floats(-5, 5), st.floats(0.05, 3), st.floats(0.01, 3))
def test_what_friction_leaves_of_an_uncertain_rate_is_the_integral(v, sd, b) -> None:  # type: ignore[no-untyped-def]
    def threshold(x: float) -> float:
        return float(np.sign(x) * max(abs(x) - b, 0.0))

    def mean(f) -> float:  # type: ignore[no-untyped-def]
        return float(
            integrate.quad(
                lambda x: f(x) * norm.pdf(x, v, sd),
                v - 9 * sd,
                v + 9 * sd,
                points=[-b, b],
                limit=200,
            )[0]
        )

    m, rho, var = soft_threshold(v, sd, b)
    expected = mean(threshold)
    assert m == pytest.approx(expected, abs=2e-6)
    assert rho == pytest.approx(mean(lambda x: float(abs(x) > b)), abs=2e-6)
    assert var == pytest.approx(mean(lambda x: (threshold(x) - expected) ** 2), abs=5e-6)


def test_a_rate_known_exactly_is_thresholded() -> None:
    assert soft_threshold(0.5, 0.0, 0.2) == pytest.approx((0.3, 1.0, 0.0))
    assert soft_threshold(-0.5, 0.0, 0.2) == pytest.approx((-0.3, 1.0, 0.0))
    assert soft_threshold(0.1, 0.0, 0.2) == (0.0, 0.0, 0.0)
    assert soft_threshold(0.1, 0.0, -0.2) == pytest.approx((0.3, 1.0, 0.0))  # a fit about zero


def test_the_covariance_shrinks_as_the_states_do() -> None:
    """P ← T P Tᵀ for the map that `apply_dry_friction` is to first order, here by sampling it."""
    model = nominal(PROFILE, ("friction.coulomb.yaw",), **{"friction.coulomb.yaw.torque_Nm": 0.4})
    plant, h = _Plant(model), DT
    rng = np.random.default_rng(0)
    L = rng.normal(0, 1e-3, (6, 6))
    P = L @ L.T
    mean = np.array([0.1, 0.2, 0.0, 0.0, 0.0, 5e-4])

    def settled(x: np.ndarray, sd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, w = x.copy(), np.zeros((8, 3))
        w[3] = sd
        apply_dry_friction(plant.s, x, h, *plant.effects, plant.free, w)
        return x, w

    after, w = settled(mean, np.sqrt(np.diag(P)[3:]))
    samples = rng.multivariate_normal(mean, P, 40_000)
    moved = np.array([settled(x, np.zeros(3))[0] for x in samples])
    got = P.copy()
    apply_friction_to_covariance(got, h, w, np.empty(6))
    np.testing.assert_allclose(after, moved.mean(axis=0), atol=3e-5)
    np.testing.assert_allclose(got, np.cov(moved.T), atol=0.03 * np.diag(P).max())
