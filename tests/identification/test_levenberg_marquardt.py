"""Levenberg–Marquardt: known minima, and steps at bounds."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.identification.greybox.levenberg_marquardt import LeastSquares, descend, follow_on

WIDE = np.full(2, 10.0)


def rosenbrock(z: np.ndarray) -> np.ndarray:
    """Its minimum is at (1, 1)."""
    return np.array([10 * (z[1] - z[0] ** 2), 1 - z[0]])


def least_squares_problem(residuals, low=-WIDE, high=WIDE, prior=0.0, calls=None) -> LeastSquares:  # type: ignore[no-untyped-def]
    def counted(z: np.ndarray) -> np.ndarray:
        if calls is not None:
            calls.append(z)
        return np.asarray(residuals(z))

    return LeastSquares(counted, np.zeros(2), prior * np.eye(2), low, high, 1e-6)


def test_descend_and_follow_on_reach_the_same_minimum() -> None:
    v = least_squares_problem(rosenbrock)
    z = np.array([-1.2, 1.0])
    assert descend(v, z, rounds=50, settled=1e-9).z == pytest.approx([1, 1], abs=1e-3)
    result = follow_on(v, z, None, settled=1e-9, max_evaluations=200, fresh=20)
    assert result.z == pytest.approx([1, 1], abs=1e-3)
    assert result.settled


def test_follow_on_needs_no_new_tangents_near_a_minimum() -> None:
    """A linear residual with tangents 20 % off: Broyden updates correct them."""
    A, b = np.array([[2.0, 1.0], [0.0, 1.0], [1.0, -1.0]]), np.array([1.0, 2.0, 3.0])
    calls: list[np.ndarray] = []
    v = least_squares_problem(lambda z: A @ z - b, calls=calls)
    result = follow_on(v, np.zeros(2), 1.2 * A.T, settled=1e-9)
    assert result.z == pytest.approx(np.linalg.lstsq(A, b, rcond=None)[0], abs=1e-4)
    assert len(calls) < 12


def test_the_prior_pulls_towards_its_centre() -> None:
    """(z − 4)² + z² is least at 2."""
    result = descend(
        least_squares_problem(lambda z: z - 4, prior=1.0), np.ones(2), rounds=9, settled=1e-9
    )
    assert result.z == pytest.approx([2, 2], abs=1e-3)


def test_a_coordinate_at_its_bound_changes_the_others() -> None:
    """z_0 + z_1 = 6 and z_0 = z_1 + 2 with z_0 ≤ 3: z_1 = 2."""
    low, high = -WIDE, np.array([3.0, 10.0])
    v = least_squares_problem(lambda z: np.array([z[0] + z[1] - 6, z[0] - z[1] - 2]), low, high)
    r, D = np.array([-6.0, -2.0]), np.array([[1.0, 1.0], [1.0, -1.0]])
    assert v.step(np.zeros(2), D @ r, D @ D.T, 0.0) == pytest.approx([3, 2])


def test_a_step_may_leave_a_bound_but_not_cross_it() -> None:
    v = least_squares_problem(rosenbrock, low=np.zeros(2), high=WIDE)
    assert v.step(np.zeros(2), np.array([1.0, -1.0]), np.eye(2), 0.0) == pytest.approx([0, 1])
