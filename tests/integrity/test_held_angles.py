"""Angles that a log holds for several rows are bad data; slow, still and jittery axes are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.integrity import Kind
from heli3dof.recording.recording import Recording
from tests.integrity.flights import STOPPING, flight, names, only


def held(r: Recording, spacing: list[int], axes: tuple[int, ...] = (0, 1, 2)) -> Recording:
    """Return a log of ``r`` whose ``axes`` are read at rows with the repeating ``spacing``."""
    read = np.cumsum([0, *spacing * len(r)])
    row = read[np.searchsorted(read, np.arange(len(r)), side="right") - 1]
    angle = r.angle.copy()
    angle[:, axes] = r.angle[np.ix_(row, axes)]
    return replace(r, angle=angle, channels={}, meta={"source": "import", "name": "log"})


@pytest.mark.parametrize(
    ("spacing", "rate"), [([10], "50"), ([2], "250"), ([4, 3, 3], "150"), ([3, 3, 4, 3, 4], "147")]
)
def test_held_angles_are_bad_data_with_the_rate_to_import(spacing: list[int], rate: str) -> None:
    fault = only(held(flight(rate_hz=500.0), spacing))
    assert (fault.check, fault.kind) == ("clock.held", Kind.BAD_DATA)
    assert "yaw every " in fault.sentence
    chosen = float(fault.fix.removeprefix("import the log with --rate "))
    assert chosen == pytest.approx(float(rate), rel=0.02)


def test_one_slow_encoder_is_named() -> None:
    fault = only(held(flight(rate_hz=500.0), [5], axes=(2,)))
    assert fault.axis == "yaw"
    assert "only: yaw every 5 rows (100 Hz)." in fault.sentence
    assert fault.fix == "import the log with --rate 100"


@pytest.mark.parametrize("hide", ["", "timing.jitter:0.001", "timing.gaps:0.05"])
@pytest.mark.parametrize("plan", ["rich", "run-step"])
def test_angles_read_in_every_row_are_no_bad_data(plan: str, hide: str) -> None:
    assert names(flight(plan, hide, rate_hz=1000.0, until_s=12.0), *STOPPING) == set()


def test_held_angles_are_no_jitter() -> None:
    assert "timing.jitter" not in names(held(flight(rate_hz=500.0), [10]))


def test_repeated_rows_are_reported_once() -> None:
    r = held(flight(rate_hz=500.0), [5])
    same = np.arange(len(r)) // 5 * 5
    whole = replace(r, voltage=r.voltage[same], voltage_cmd=r.voltage_cmd[same],
                    voltage_extra=r.voltage_extra[same])  # fmt: skip
    assert names(whole, Kind.BAD_DATA) == {"clock.repeated"}
