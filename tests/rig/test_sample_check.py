"""A sample is made of numbers, or it says which field is none."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from heli3dof.rig.interface import Flags, Sample
from heli3dof.rig.sample_check import unreadable

GOOD = Sample(7, 1.5, (1, -2, 3), (5.0, 5.0), (nan, nan), Flags.ENABLED, 12.0)


def test_a_sound_sample_says_nothing() -> None:
    assert unreadable(GOOD) is None
    assert unreadable(replace(GOOD, counts=(np.int64(1), np.int32(2), 3))) is None
    assert unreadable(replace(GOOD, v_applied=(nan, nan))) is None


@pytest.mark.parametrize("bad", [nan, inf, 1.5, None, "12", 1 << 63, np.float64(nan)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_count_that_is_no_whole_number_is_named(bad: object, axis: int) -> None:
    counts = [1, 2, 3]
    counts[axis] = bad  # type: ignore[call-overload]
    said = unreadable(replace(GOOD, counts=tuple(counts)))
    assert said is not None
    assert ("roll", "pitch", "yaw")[axis] in said


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("sequence", nan), ("flags", None), ("device_time_s", nan), ("device_time_s", inf),
        ("host_time_s", nan), ("host_time_s", None), ("counts", (1, 2)), ("counts", (1, 2, 3, 4)),
    ],
)  # fmt: skip
def test_every_other_field_is_named_too(field: str, value: object) -> None:
    assert unreadable(replace(GOOD, **{field: value})) is not None  # type: ignore[arg-type]


def test_what_is_no_sample_at_all_is_said_to_be_none() -> None:
    assert unreadable(None) == "None is no Sample"
