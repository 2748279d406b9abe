"""Recordings made of arrays have the checks of an imported log."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import heli3dof as h3
from heli3dof.errors import Heli3dofError, RecordingError, UsageError
from heli3dof.recording.recording import Recording
from tests.recording.make import flight


@pytest.fixture(scope="module")
def flown() -> Recording:
    return flight(3000)


def made(r: Recording, **changed: Any) -> Recording:
    arrays = {"t": r.t, "voltage": r.voltage, "angle": r.angle, "profile": r.profile, **changed}
    return h3.make_recording(**arrays)


def test_the_arrays_of_a_flight_are_its_recording(flown: Recording) -> None:
    same = made(flown, reference=flown.reference, channels={"gust_m_s": np.zeros(3000)})
    assert same.digest == flown.digest
    assert same.has_reference("roll")
    assert not same.has_cmd
    assert same.meta["warnings"] == []
    assert list(same.channels) == ["gust_m_s"]
    angle = flown.angle.copy()
    angle[:, 1] = np.nan
    assert made(flown, angle=angle).axes == ("roll", "yaw")


@pytest.mark.parametrize(
    ("changed", "message", "error"),
    [
        (lambda r: {"angle": np.rad2deg(r.angle)}, "does not look like radians", RecordingError),
        (lambda r: {"angle": np.rint(r.angle * 4096 / (2 * np.pi))}, "raw encoder counts",
         RecordingError),
        (lambda r: {"t": r.t[::-1]}, "time does not increase at sample 1", RecordingError),
        (lambda r: {"t": 1e3 * r.t}, "t_s steps by 2", RecordingError),
        (lambda r: {"voltage": 1e3 * r.voltage}, "v_front_V reaches", RecordingError),
        (lambda r: {"angle": np.where(r.t[:, None] > 1, np.nan, r.angle)}, "no number",
         RecordingError),
        (lambda r: {"channels": {"a": np.zeros(3)}}, r"channels\['a'\] has the shape \(3,\)",
         UsageError),
        (lambda r: {"channels": {"roll_deg": r.t}}, "the name of a column, roll_deg", UsageError),
        (lambda r: {"voltage": r.voltage[:, :1]}, r"voltage has the shape \(3000, 1\)", UsageError),
        (lambda r: {"angle": 1j * r.angle}, "angle is not an array of real numbers", UsageError),
        (lambda r: {"t": 0.002}, "t has the shape", UsageError),
        (lambda r: {"t": "now"}, "t is not an array of real numbers", UsageError),
    ],
)  # fmt: skip
def test_arrays_that_no_rig_can_have_are_refused(
    flown: Recording, changed: Any, message: str, error: type[Heli3dofError]
) -> None:
    with pytest.raises(error, match=message) as caught:
        made(flown, **changed(flown))
    assert "--map" not in str(caught.value)


def test_masked_elements_are_lost_samples(flown: Recording) -> None:
    masked = np.zeros_like(flown.angle, dtype=bool)
    masked[1000:1100, 0] = True
    gust = np.ma.masked_equal(np.arange(3000), 5)
    lossy = made(flown, angle=np.ma.array(flown.angle, mask=masked), channels={"gust": gust})
    assert len(lossy) == 2900
    assert "100 of 3000 rows" in lossy.meta["warnings"][0]
    assert np.flatnonzero(np.isnan(lossy.channels["gust"])).tolist() == [5]
