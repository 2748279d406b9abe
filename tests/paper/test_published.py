from __future__ import annotations

import numpy as np
import pytest

from heli3dof.paper.published import TABLE_II, TEXT, published
from heli3dof.paper.reproduction import paper_step, reproduce
from tests.comparison.fakes import FakeHover


def test_table_ii_stands_as_printed() -> None:
    printed = {
        axis: [
            published(axis, "hover", "peak_difference"),
            published(axis, "identification", "peak_difference"),
            published(axis, "hover", "error_difference"),
            published(axis, "identification", "error_difference"),
        ]
        for axis in ("roll", "pitch", "yaw")
    }
    values = {axis: [p.value_deg for p in row if p] for axis, row in printed.items()}
    assert values == {"roll": [11, 1, 0, 1], "pitch": [13, 8, 2, 1], "yaw": [23, 3, 7, 0]}


def test_table_ii_is_the_difference_of_the_text_s_peaks_from_the_experiment() -> None:
    """E11 and E10, computed: 23 − 12 = 11, 23 − 22 = 1, 23 − 20 = 3, and peaks they are."""
    for axis, subject in (("roll", "hover"), ("roll", "identification"), ("yaw", "identification")):
        experiment = published(axis, "experiment", "peak")
        model = published(axis, subject, "peak")
        table = published(axis, subject, "peak_difference")
        assert experiment is not None
        assert model is not None
        assert table is not None
        assert experiment.value_deg - model.value_deg == table.value_deg


def test_only_the_hover_model_s_own_numbers_are_called_reproducible() -> None:
    assert not any(p.reproducible for p in TABLE_II)
    assert {p.subject for p in TEXT if p.reproducible} == {"hover"}
    assert all(p.why for p in (*TEXT, *TABLE_II))


def test_the_reproducible_numbers_are_reproduced_to_the_printed_digit() -> None:
    rows = [r for r in reproduce(FakeHover()) if r.published.reproducible]
    assert len(rows) == 6
    for row in rows:
        assert round(row.ours_deg) == row.published.value_deg, row.published


def test_the_others_are_left_open_rather_than_guessed() -> None:
    for row in reproduce(FakeHover()):
        if not row.published.reproducible:
            assert np.isnan(row.ours_deg)
    assert all(np.isnan(r.ours_deg) for r in reproduce(None))


def test_the_paper_s_step_is_ten_degrees_from_level() -> None:
    task = paper_step()
    assert np.degrees(task.reference[0]) == pytest.approx([10, 0, 0])
    assert task.angle0 == pytest.approx([0, 0, 0])
    assert len(task.reference) == 5001
