"""A sample consists of numbers; otherwise the check names the field."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from heli3dof.errors import DeviceError
from heli3dof.rig.interface import Flags, Sample
from heli3dof.rig.sample_check import check_sample, sample_problem, unusable_sample

GOOD = Sample(7, 1.5, (1, -2, 3), (5.0, 5.0), (nan, nan), Flags.ENABLED, 12.0)


def test_a_good_sample_passes() -> None:
    assert sample_problem(GOOD) is None
    assert unusable_sample(GOOD) is None
    check_sample(GOOD)
    assert sample_problem(replace(GOOD, counts=(np.int64(1), np.int32(2), 3))) is None
    assert sample_problem(replace(GOOD, v_applied=(nan, nan))) is None


@pytest.mark.parametrize("bad", [nan, inf, 1.5, None, "12", 1 << 63, np.float64(nan)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_count_that_is_not_a_whole_number_is_named(bad: object, axis: int) -> None:
    counts = [1, 2, 3]
    counts[axis] = bad  # type: ignore[call-overload]
    problem = sample_problem(replace(GOOD, counts=tuple(counts)))
    assert problem is not None
    assert ("roll", "pitch", "yaw")[axis] in problem


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("sequence", nan), ("flags", None), ("device_time_s", nan), ("device_time_s", inf),
        ("host_time_s", nan), ("host_time_s", None), ("counts", (1, 2)), ("counts", (1, 2, 3, 4)),
    ],
)  # fmt: skip
def test_every_other_field_is_checked(field: str, value: object) -> None:
    assert sample_problem(replace(GOOD, **{field: value})) is not None  # type: ignore[arg-type]


def test_another_object_is_not_a_sample() -> None:
    assert sample_problem(None) == "None is no Sample"


def test_the_trip_and_the_error_have_the_same_words() -> None:
    bad = replace(GOOD, counts=(1, 2))
    trip = unusable_sample(bad)
    assert trip == "the rig's driver gave a sample that cannot be used: 2 counts instead of 3"
    with pytest.raises(DeviceError, match=r"The rig.s driver gave .* 2 counts instead of 3") as e:
        check_sample(bad)
    assert (e.value.cause, e.value.fix) == (trip.cause, trip.fix)
