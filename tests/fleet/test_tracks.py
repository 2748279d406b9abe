"""Rows of a batch become tracks; bad data and missing values do not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from heli3dof.errors import RecordingError, UsageError
from heli3dof.fleet.tracks import (
    main_plan,
    quantities_of,
    read_rows,
    tracks_of,
    usable_and_bad,
    with_distinct_rig_names,
)


def row(name: str, **values: Any) -> dict[str, Any]:
    common = {"recording": f"{name}.mcap", "name": name, "rig": "a", "exit_code": 0.0}
    return {**common, "g": 1.0, "g_std": 0.1, **values}


def test_cells_become_numbers_texts_and_none(tmp_path: Path) -> None:
    text = "recording,rig,exit_code,g,g_std\nx.mcap,7,0,1.5,\ny.mcap,7,0,nan,0.1\n"
    (tmp_path / "results.csv").write_text(text, encoding="utf-8")
    first, second = read_rows(tmp_path)
    assert first == {"recording": "x.mcap", "rig": "7", "exit_code": 0.0, "g": 1.5, "g_std": None}
    assert np.isnan(second["g"])


@pytest.mark.parametrize(
    ("text", "error", "what"),
    [
        (None, UsageError, "no results.csv"),
        ("", RecordingError, "column recording is missing"),
        ("recording,rig,exit_code\n", RecordingError, "no rows"),
        ("recording,exit_code\nx,0\n", RecordingError, "column rig is missing"),
        ("recording,rig,exit_code\n\x00\xff\n", RecordingError, "cannot be used"),
    ],
)
def test_files_that_cannot_be_used(tmp_path: Path, text, error, what) -> None:
    if text is not None:
        (tmp_path / "results.csv").write_bytes(text.encode("latin-1"))
    with pytest.raises(error, match=what):
        read_rows(tmp_path)


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no folder"):
        read_rows(tmp_path / "none")


def test_failed_recordings_are_bad_data_and_in_no_track() -> None:
    rows = [
        row("x"),
        row("y", exit_code=5.0, error="torn"),
        row("z", faults="clock.gaps;clock.jitter"),
        row("w", exit_code=None),
    ]
    usable, bad = usable_and_bad(rows)
    assert [b.reason for b in bad] == [
        "exit code 5: torn", "clock.gaps;clock.jitter", "no exit code",
    ]  # fmt: skip
    (track,) = tracks_of(usable, quantities_of(usable))
    assert track.flights == ("x",)


def test_a_recording_that_appears_twice_counts_once() -> None:
    """The first usable one counts; recordings without a digest cannot be compared."""
    rows = [
        row("torn", digest="d1", exit_code=5.0, error="torn"), row("x", digest="d1"),
        row("copy", digest="d1"), row("y", digest="d2"), row("v"), row("w"),
    ]  # fmt: skip
    usable, bad = usable_and_bad(rows)
    (track,) = tracks_of(usable, ["g"])
    assert track.flights == ("v", "w", "x", "y")
    assert [(b.recording, b.reason) for b in bad] == [
        ("torn.mcap", "exit code 5: torn"), ("copy.mcap", "the same samples as x.mcap"),
    ]  # fmt: skip


def test_bootstrap_replicates_are_no_recordings(tmp_path: Path) -> None:
    text = "recording,rig,exit_code,replicate\nx.mcap,a,0,0\nx.mcap,a,0,1\ny.mcap,a,5,\n"
    (tmp_path / "results.csv").write_text(text, encoding="utf-8")
    assert [r["recording"] for r in read_rows(tmp_path)] == ["x.mcap", "y.mcap"]


def test_each_flight_has_its_plan_and_the_main_plan_is_that_of_most() -> None:
    rows = [row("a", plan="rich"), row("b", plan="steps"), row("c", plan="rich"), row("d")]
    (track,) = tracks_of(rows, ["g"])
    assert track.plans.tolist() == ["rich", "steps", "rich", ""]
    assert main_plan(rows) == "rich"
    assert main_plan([row("a"), row("b")]) == ""


def test_values_without_a_usable_deviation_are_left_out() -> None:
    rows = [
        row("a"), row("b", g=np.nan), row("c", g=None), row("d", g_std=None), row("e", g_std=0.0),
        row("f", g_std=np.inf), row("g", g="text"),
    ]  # fmt: skip
    (track,) = tracks_of(rows, quantities_of(rows))
    assert track.flights == ("a",)


def test_rounding_errors_are_no_scatter() -> None:
    rows = [row("a", g=-30.3668), row("b", g=-30.3668 * (1 + 2e-16)), row("c", g=-30.36680001)]
    (track,) = tracks_of(rows, ["g"])
    assert track.y.tolist() == [-30.3668, -30.3668, -30.36680001]


def test_quantities_have_a_deviation_or_need_none() -> None:
    rows = [row("a", h=1.0, jitter_s=1e-5, k=None, k_std=None)]
    assert quantities_of(rows) == ("g", "jitter_s")


def test_flights_are_in_order_of_time() -> None:
    rows = [
        row("a", g=2.0, started_utc="2026-09-08T00:00:00+00:00"),
        row("b", g=1.0, started_utc="2026-09-07T12:00:00Z"),
        row("c", g=3.0, started_utc="2026-09-08T12:00:00"),
    ]
    (track,) = tracks_of(rows, ["g"])
    assert track.y.tolist() == [1.0, 2.0, 3.0]
    assert np.diff(track.t) == pytest.approx([0.5, 0.5])
    assert track.dated


@pytest.mark.parametrize("start", [None, "yesterday", "2026-09-07T12:00:00Z"])
def test_flights_without_distinct_starts_are_in_order_of_their_names(start) -> None:
    rows = [row("b", g=2.0, started_utc=start), row("a", g=1.0, started_utc=start)]
    (track,) = tracks_of(rows, ["g"])
    assert (track.y.tolist(), track.t.tolist(), track.dated) == ([1.0, 2.0], [0.0, 1.0], False)


def test_tracks_of_each_rig_in_order_of_the_names() -> None:
    rows = [row("a", rig="r2"), row("b", rig="r1"), row("c", rig=None)]
    assert [t.rig for t in tracks_of(rows, ["g"])] == ["r1", "r2", "–"]


def test_serial_numbers_tell_rigs_with_the_same_profile_apart() -> None:
    rows = [row("x", serial="S1"), row("y", serial="S2"), row("z"), row("b", rig="b", serial="S3")]
    named = with_distinct_rig_names(rows)
    assert [r["rig"] for r in named] == ["a (S1)", "a (S2)", "a", "b"]
    assert with_distinct_rig_names(rows[:1]) == rows[:1]
