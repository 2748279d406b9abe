"""A log at a lower rate: which rows are kept, and the voltages' means."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.errors import RecordingError, UsageError
from heli3dof.recording.logs.column_mapping import mapped
from heli3dof.recording.logs.importer import Table
from heli3dof.recording.logs.joined_tables import join
from heli3dof.recording.logs.lower_rate import at_rate, interval_means, with_mean_voltages
from tests.recording.make import open_profile

PROFILE = open_profile()
N = 6000
STEP_DEG = float(np.degrees(PROFILE.encoder.rad_per_count[2]))


def log(spacing: list[int], first: int = 0) -> Table:
    """A log at 1 kHz whose yaw is read at row ``first``, then at rows with this ``spacing``."""
    read = first + np.cumsum([0, *spacing * N])
    row = read[np.clip(np.searchsorted(read, np.arange(N), side="right") - 1, 0, None)]
    yaw = np.rint(1000 * np.sin(row / 800)) * STEP_DEG
    k = np.arange(N)
    columns = {"t_s": k / 1000, "v_front_V": 0.0 + k, "v_back_V": -1.0 * k, "yaw_deg": yaw}
    return Table("log.csv", columns, lambda k: f"line {k + 2}")


def test_means_run_from_each_row_to_the_one_before_the_next() -> None:
    values = np.arange(20.0)
    np.testing.assert_array_equal(interval_means(values, np.array([1, 4, 9])), [2, 6, 11])
    np.testing.assert_array_equal(interval_means(values, np.array([10, 19])), [14, 19])


def test_the_rows_in_which_a_held_angle_changes_are_kept() -> None:
    table = at_rate(log([10], first=4), PROFILE, 100)
    t = table.columns["t_s"]
    np.testing.assert_allclose(t, np.arange(4, N, 10) / 1000)
    np.testing.assert_allclose(table.columns["v_front_V"][:-1], 1000 * t[:-1] + 4.5)
    assert table.where(1) == "line 16"


def test_rows_at_alternating_distances_get_even_times() -> None:
    t = at_rate(log([4, 3, 3]), PROFILE, 295).columns["t_s"]
    np.testing.assert_allclose(np.diff(t), 1e-2 / 3, rtol=1e-3)


def test_without_held_angles_every_mth_row_is_kept() -> None:
    table = at_rate(log([1]), PROFILE, 250)
    np.testing.assert_allclose(table.columns["t_s"], np.arange(0, N, 4) / 1000)
    assert at_rate(table, PROFILE, 250) is table
    with pytest.raises(UsageError, match="exceeds the log's rate, 250 Hz"):
        at_rate(table, PROFILE, 500)


@pytest.mark.parametrize(
    ("spacing", "rate_hz", "usable"),
    [
        ([1], 600, "--rate 500"),
        ([1], 300, "--rate 333.3 or --rate 250"),
        ([10], 60, "--rate 100 or --rate 50"),
        ([4, 3, 3], 200, "--rate 300 or --rate 150"),
    ],
)
def test_rates_without_evenly_spaced_rows_are_refused(
    spacing: list[int], rate_hz: float, usable: str
) -> None:
    with pytest.raises(UsageError, match="is not a whole multiple of it") as caught:
        at_rate(log(spacing), PROFILE, rate_hz)
    assert caught.value.fix.split()[::3] == usable.split()[::3]
    rates = [float(word) for word in caught.value.fix.split()[1::3]]
    assert rates == pytest.approx([float(word) for word in usable.split()[1::3]], rel=0.03)
    assert at_rate(log(spacing), PROFILE, rates[-1]) is not None


def test_rates_above_that_of_the_readings_keep_true_times() -> None:
    t = at_rate(log([10], first=4), PROFILE, 333).columns["t_s"]
    np.testing.assert_allclose(t, np.arange(0, N, 3) / 1000)


def test_time_must_increase() -> None:
    table = log([1])
    table.columns["t_s"][5] = 0
    with pytest.raises(RecordingError, match="time does not increase at line 7"):
        at_rate(table, PROFILE, 100)


def test_the_voltages_of_a_faster_file_are_averaged_whatever_their_names() -> None:
    k = np.arange(100.0)
    volts = Table("v.csv", {"t_s": k / 1000, "u": k, "v_back_V": -k}, str)
    angle = Table("a.csv", {"t_s": k[:10] / 100, "roll_deg": k[:10]}, str)
    joined = join([volts, angle])
    assert "The other rows are kept, with the mean of each voltage" in joined.warnings[0]
    assert joined.warnings[0].endswith("If the profile has another loop.rate_hz, add --rate 100.")
    table = with_mean_voltages(mapped(joined, {"v_front_V": "2*u", "pitch_deg": "u"}, {}))
    np.testing.assert_array_equal(table.columns["v_front_V"], 2 * (10 * k[:10] + 4.5))
    np.testing.assert_array_equal(table.columns["v_back_V"], -(10 * k[:10] + 4.5))
    np.testing.assert_array_equal(table.columns["pitch_deg"], 10 * k[:10])
