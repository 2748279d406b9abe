"""The stretch of a flight with the largest error, and its figure."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.diagnosis.validation.gain import HeldOut, Predictions
from heli3dof.report.figures.style import to_svg
from heli3dof.report.figures.worst_stretch import stretch_figure, worst_stretch

AXES = 3


def held_out(errors_rad: list[list[float]]) -> HeldOut:
    """Cells of 2 s with one prediction per axis; NaN: no prediction."""
    e = np.array(errors_rad)
    m, counts = len(e), np.isfinite(e).astype(float)
    t, zeros = np.arange(0.0, 2 * m, 0.5), np.zeros((4 * m, AXES))
    course = Predictions(t, np.zeros(4 * m, dtype=int), zeros, zeros + 0.01)
    return HeldOut(
        np.zeros(m), np.nan_to_num(e) ** 2, counts, 2.0 * np.arange(m), np.zeros(m, dtype=int),
        "holdout", course,
    )  # fmt: skip


BEFORE = held_out([[0.02, 0.1, np.nan], [0.06, 0.1, np.nan], [0.02, 0.2, np.nan]])
AFTER = held_out([[0.01, 0.1, np.nan], [0.02, 0.1, np.nan], [0.01, 0.1, np.nan]])


def test_the_error_is_relative_to_what_is_usual_on_its_axis() -> None:
    """Roll: 0.06 rad over a median of 0.01; pitch: 0.2 rad, but over a median of 0.1."""
    worst = worst_stretch(BEFORE, AFTER)
    assert worst is not None
    assert (worst.axis, worst.start_s, worst.stop_s) == ("roll", 2.0, 4.0)
    assert worst.before_deg == pytest.approx(np.degrees(0.06))
    assert worst.after_deg == pytest.approx(np.degrees(0.02))


def test_without_predictions_there_is_no_stretch() -> None:
    nothing = held_out([[np.nan] * AXES] * 2)
    assert worst_stretch(nothing, nothing) is None


def test_the_figure_is_the_same_each_time_and_states_both_errors() -> None:
    worst = worst_stretch(BEFORE, AFTER)
    assert worst is not None
    drawn = [to_svg(stretch_figure(BEFORE, AFTER, worst, "flight")) for _ in range(2)]
    assert drawn[0] == drawn[1]
    assert "<svg" in drawn[0]
