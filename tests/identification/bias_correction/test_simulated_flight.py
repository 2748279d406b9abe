"""Simulated flights of recordings with holes."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.identification.bias_correction.simulated_flight import (
    STEP_S,
    reference_changes,
    simulated_flight,
)
from heli3dof.model.greybox.model import nominal
from tests.flown import flown


@pytest.mark.parametrize("start_s", [4.1, 7.0, 9.2, 10.0])
def test_a_step_in_a_hole_comes_when_it_was_flown(start_s: float) -> None:
    r = flown("steps", 20.0, device="mock:?speed=max")  # roll steps by 10° after 10 s
    t = r.elapsed_s
    stop_s = max(start_s + 1.5, 10.2)
    cut = r.rows((t < start_s) | (t >= stop_s))
    ((row, change_s),) = reference_changes(cut).items()
    assert t[row] < start_s <= t[row + 1]
    assert change_s - r.t[0] == pytest.approx(10.0, abs=STEP_S)
    simulated = simulated_flight(nominal(r.profile), cut, np.random.default_rng(1))
    apart = np.abs(simulated.angle - cut.angle)[cut.elapsed_s >= stop_s, 0]
    assert np.degrees(apart).max() < 2.0


def test_equal_references_before_and_after_a_hole_do_not_change_in_it() -> None:
    r = flown("steps", 20.0, device="mock:?speed=max")
    t = r.elapsed_s
    assert reference_changes(r) == {}
    assert reference_changes(r.rows((t < 5.0) | (t >= 7.0))) == {}
