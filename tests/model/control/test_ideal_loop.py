"""The golden numbers of the paper's loop in continuous time, to the last digit printed."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.model.linear.hover import hover
from tests.model.control.ideal_loop import Response, loop_poles, paper_gain, step_response
from tests.model.examples import DEG, PRINTED_V_O, PROFILE, K_g

H = hover(PROFILE)


def respond(roll: float = 0.0, yaw: float = 0.0, **options: object) -> Response:
    return step_response(H, K_g, np.radians([roll, 0.0, yaw]), **options)  # type: ignore[arg-type]


def peak(response: Response, axis: int) -> tuple[float, float]:
    """(degrees, seconds) of the largest angle."""
    k = int(response.angle[:, axis].argmax())
    return response.angle[k, axis] / DEG, float(response.t[k])


def test_closed_loop_poles_are_the_golden_eight() -> None:
    golden = [-0.100, -0.317, -1.144 + 1.865j, -1.144 - 1.865j]
    golden += [-1.537 + 0.790j, -1.537 - 0.790j, -1.635 + 1.656j, -1.635 - 1.656j]
    assert loop_poles(H, K_g).round(3).tolist() == golden


def test_lqr_of_the_corrected_model_is_the_printed_gain_before_truncation() -> None:
    K = paper_gain(hover(PRINTED_V_O))
    front = [37.6707, 13.2126, -11.4978, 20.9542, 4.7687, -16.0993, 10.0, -1.0]
    assert K[0].round(4).tolist() == front
    mirrored = np.array(front) * [1, -1, -1, 1, -1, -1, 1, -1]
    assert K[1].round(4).tolist() == mirrored.tolist()
    # (14) as the paper prints it: the front row cut down to one decimal, the back row its mirror.
    assert (np.floor(K[0].round(6) * 10) / 10).tolist() == K_g[0].tolist()
    assert abs(K_g).tolist()[0] == abs(K_g).tolist()[1]


def test_python_control_finds_the_same_lqr_gain() -> None:
    import control

    h = hover(PRINTED_V_O)
    A, B = np.zeros((8, 8)), np.zeros((8, 2))
    A[:6, :6], B[:6] = h.A, h.B
    A[6, 0] = A[7, 2] = 1.0
    K, _, _ = control.lqr(A, B, np.diag([100, 1, 10, 0, 0, 2, 10, 0.1]), 0.05 * np.eye(2))
    np.testing.assert_allclose(K, paper_gain(h), rtol=1e-6)


def test_a_10_degree_roll_step_peaks_at_11_85_degrees_at_1_77_s() -> None:
    r = respond(roll=10)
    top, at = peak(r, 0)
    assert round(top, 2) == 11.85
    assert round(at, 2) == 1.77
    assert round(float(r.angle[10_000, 0] / DEG), 2) == 10.10
    outside = abs(r.angle[:, 0] / DEG - 10) > 0.2
    assert round(float(r.t[outside][-1]), 1) == 7.7
    assert round(float(r.voltage.max()), 2) == 6.56
    assert H.V_o + r.voltage.max() < 24


def test_a_roll_step_leaves_pitch_and_yaw_where_they_are() -> None:
    assert abs(respond(roll=10).angle[:, 1:]).max() < 1e-13


def test_the_reference_limit_changes_the_roll_peak_little_and_the_voltage_much() -> None:
    r = respond(roll=10, rate_limit=45 * DEG)
    top, at = peak(r, 0)
    assert round(top, 2) == 11.84
    assert round(at, 2) == 1.89
    assert round(float(r.voltage.max()), 2) == 4.43


def test_a_10_degree_yaw_step_peaks_at_11_61_degrees_and_tilts_the_body_both_ways() -> None:
    r = respond(yaw=10)
    top, at = peak(r, 2)
    assert round(top, 2) == 11.61
    assert round(at, 1) == 3.2
    assert round(float(r.angle[:, 1].min() / DEG), 2) == -7.11
    assert round(float(r.angle[:, 1].max() / DEG), 2) == 5.01
    assert abs(r.angle[:, 0]).max() < 1e-13


def test_a_20_degree_yaw_step_behind_the_reference_limit() -> None:
    r = respond(yaw=20, rate_limit=45 * DEG)
    assert round(peak(r, 2)[0], 2) == 23.19
    # The checked paper says −13.52. It is −13.515 by matrix exponentials, 0.01 off.
    assert float(r.angle[:, 1].min() / DEG) == pytest.approx(-13.515, abs=0.001)


def test_from_rest_on_the_table_the_roll_peak_is_17_1_degrees() -> None:
    r = respond(roll=10, angle0=np.radians([-27.5, 0, 0]), v_max=24.0, duration_s=4.0, dt=2e-3)
    assert round(peak(r, 0)[0], 1) == 17.1
    assert (r.voltage + H.V_o).max() == pytest.approx(24.0)


def test_the_limited_integrator_agrees_with_the_exact_one_where_no_limit_is_reached() -> None:
    ramp = {"rate_limit": 45 * DEG, "duration_s": 3.0, "dt": 2e-3}
    exact, limited = respond(roll=10, **ramp), respond(roll=10, v_max=1e3, **ramp)
    np.testing.assert_allclose(limited.angle, exact.angle, atol=2e-5)


def test_the_response_does_not_depend_on_the_grid() -> None:
    fine = respond(yaw=20, rate_limit=45 * DEG, duration_s=3.0)
    coarse = respond(yaw=20, rate_limit=45 * DEG, duration_s=3.0, dt=0.05)
    np.testing.assert_allclose(fine.angle[::50], coarse.angle, atol=1e-12)
