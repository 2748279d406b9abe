"""Differences of uptimes that wrap at 2³² ms."""

from __future__ import annotations

import pytest

from heli3dof.rig.uptime import UPTIME_WRAP_S, wrapped_difference_s


@pytest.mark.parametrize(
    ("a_s", "b_s", "difference_s"),
    [
        (5.0, 3.0, 2.0),
        (3.0, 5.0, -2.0),
        (1.0, UPTIME_WRAP_S - 1.0, 2.0),
        (UPTIME_WRAP_S - 1.0, 1.0, -2.0),
        (UPTIME_WRAP_S / 2, 0.0, -UPTIME_WRAP_S / 2),
        (3 * UPTIME_WRAP_S + 1.0, 0.0, 1.0),
    ],
)
def test_the_difference_is_within_half_a_wrap(a_s: float, b_s: float, difference_s: float) -> None:
    assert wrapped_difference_s(a_s, b_s) == pytest.approx(difference_s)
