"""Sentences on what an extended model explains agree with the recordings."""

from __future__ import annotations

import pytest

from heli3dof.diagnosis.free_run.explanations import pendulum_sentence


@pytest.mark.parametrize(
    ("at_minus_10", "at_10", "word"), [(2.5, 4.9, "rises"), (4.9, 2.5, "falls")]
)
def test_the_hover_voltage_changes_in_the_measured_direction(
    at_minus_10: float, at_10: float, word: str
) -> None:
    (sentence,) = pendulum_sentence(at_minus_10, at_10, at_minus_10, at_10)
    assert f"The hover voltage {word} with roll" in sentence
    assert "unlike" not in sentence


def test_a_model_that_changes_in_the_other_direction_explains_nothing() -> None:
    assert pendulum_sentence(4.9, 2.5, 2.5, 4.9) == []
