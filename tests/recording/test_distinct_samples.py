from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.errors import UsageError
from heli3dof.experiment.plan import step_plan
from heli3dof.recording.distinct_samples import check_distinct
from heli3dof.recording.recording import Recording
from tests.flown import flown


@pytest.fixture(scope="module")
def flight() -> Recording:
    return flown("rich", 20.0, device="mock:?speed=max&seed=1")


def test_overlapping_parts_of_one_flight_are_refused(flight: Recording) -> None:
    with pytest.raises(UsageError, match=r"held-out recording .* from t = 12 s to 14\.998 s"):
        check_distinct([flight], [flight.between(12, 15)])
    with pytest.raises(UsageError, match="held-out"):
        check_distinct([flight], [flight.rows(slice(1, None))])
    with pytest.raises(UsageError, match=r"training recording .* from t = 1 s to 15\.998 s"):
        check_distinct([flight.between(0, 16), flight.between(1, 18)], [])
    with pytest.raises(UsageError, match="held-out"):
        check_distinct([flight], [flight.rows(slice(None, None, 5))])


def test_an_axis_that_was_not_logged_hides_no_overlap(flight: Recording) -> None:
    angle = flight.angle.copy()
    angle[:, 2] = np.nan
    partial = replace(flight, angle=angle)
    with pytest.raises(UsageError, match="held-out"):
        check_distinct([partial], [partial.rows(slice(1, None))])
    check_distinct([partial.between(0, 10)], [partial.between(10, 20)])


def test_disjoint_parts_and_held_out_data_given_twice_are_accepted(flight: Recording) -> None:
    check_distinct([flight.between(0, 10)], [flight.between(10, 20), flight.between(12, 20)])


def test_flights_that_rest_on_the_table_share_no_samples(flight: Recording) -> None:
    def after_rest(seed: int) -> Recording:
        """10 s on the table with motors off, then a flight; some table rows equal in all flights"""
        noisy = flight.angle + np.random.default_rng(seed).normal(0, 1e-3, flight.angle.shape)
        noisy[:5000], volts = flight.angle[0], flight.voltage.copy()
        volts[:5000] = 0.0
        return replace(flight, angle=noisy, voltage=volts)

    check_distinct([after_rest(1), after_rest(2)], [after_rest(3)])


def test_equal_climbs_of_emulated_flights_with_one_seed_are_accepted(flight: Recording) -> None:
    other = flown(step_plan(roll=10), 15.0, device="mock:?speed=max&seed=1")
    n = 3000
    np.testing.assert_array_equal(flight.angle[:n], other.angle[:n])
    check_distinct([flight], [other])
