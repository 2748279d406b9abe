"""A log of every m-th sample: the voltage's mean until its next row, and the loop's own rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.model.estimation.decimated_log import decimation, mean_voltage, with_loop_rows
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import default_profile


def log(t: np.ndarray, front: np.ndarray) -> Recording:
    n = len(t)
    nothing = np.full((n, 3), np.nan)
    voltage = np.column_stack([front, -front])
    extra = np.column_stack([front, np.zeros(n)])
    return Recording(t, voltage, nothing, nothing, voltage, extra, default_profile())


def test_five_voltages_on_a_line_from_0_to_10_have_a_mean_of_4() -> None:
    # 0, 2, 4, 6, 8 are held for a period each; 10 is the next row's.
    thin = log(0.01 * np.arange(4), np.array([0.0, 10.0, 10.0, 5.0]))
    assert decimation(thin) == 5
    assert mean_voltage(thin)[:, 0] == pytest.approx([4.0, 10.0, 8.0, 5.0])
    assert mean_voltage(thin)[:, 1] == pytest.approx([-4.0, -10.0, -8.0, -5.0])


def test_over_a_gap_there_is_no_line() -> None:
    thin = log(0.01 * np.array([0, 1, 2, 6, 7]), np.array([0.0, 10.0, 0.0, 10.0, 10.0]))
    assert mean_voltage(thin)[:, 0] == pytest.approx([4.0, 6.0, 0.0, 10.0, 10.0])


@pytest.mark.parametrize("step_s", [0.002, 0.0021, 0.0045])
def test_a_log_at_the_loop_s_rate_or_at_one_that_is_no_part_of_it_is_left_as_it_is(
    step_s: float,
) -> None:
    whole = log(step_s * np.arange(50), np.arange(50.0))
    assert decimation(whole) == 1
    assert mean_voltage(whole) is whole.voltage
    assert with_loop_rows(whole)[0] is whole


def test_a_hole_has_a_row_for_every_period_and_a_short_gap_has_none() -> None:
    t = 0.002 * np.array([0, 1, 2, 12, 13, 613, 614])  # 20 ms, then 1.2 s
    whole, at = with_loop_rows(log(t, np.arange(7.0)))
    assert at.tolist() == [0, 1, 2, 3, 4, 604, 605]
    assert np.diff(whole.t)[at[4] :] == pytest.approx(0.002)


def test_from_a_given_instant_on_a_hole_has_the_values_of_the_row_after_it() -> None:
    t = 0.002 * np.array([0, 1, 601, 602])  # 1.2 s
    whole, at = with_loop_rows(log(t, np.arange(4.0)), {1: t[1] + 1.0})
    assert at.tolist() == [0, 1, 601, 602]
    assert whole.voltage[:, 0] == pytest.approx([0.0, *[1.0] * 500, *[2.0] * 101, 3.0])


def test_what_is_filled_in_has_a_row_for_every_period_and_the_log_s_own_among_them() -> None:
    thin = log(0.01 * np.array([0, 1, 2, 4]), np.array([0.0, 10.0, 20.0, 40.0]))
    whole, at = with_loop_rows(thin)
    assert at.tolist() == [0, 5, 10, 20]
    assert np.diff(whole.t) == pytest.approx(0.002)
    assert whole.t[at] == pytest.approx(thin.t)
    assert whole.voltage_extra[:, 0] == pytest.approx(2.0 * np.arange(21))
    assert whole.rows(at).voltage == pytest.approx(thin.voltage)
    assert replace(whole, profile=thin.profile).dt == pytest.approx(0.002)
