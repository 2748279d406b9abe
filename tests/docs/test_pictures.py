"""The README's pictures are those of today's code."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.docs.pictures import FOLDER, make, rig
from tests.docs.tutorial import difference

WORDS = re.compile(r">([^<>]+)</text>")
NUMBER = re.compile(r"-?\d+\.\d+")


def words(svg: str) -> str:
    """Return the texts of an SVG picture, a line each."""
    return "\n".join(text.replace("&#160;", " ") for text in WORDS.findall(svg))


def numbers(svg: str) -> np.ndarray:
    return np.array(NUMBER.findall(svg), dtype=float)


def stored(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


def test_the_drawing_of_the_rig_is_todays() -> None:
    assert rig() == stored("rig.svg")


@pytest.mark.tutorial
def test_the_session_and_the_cause_are_those_of_todays_code(tmp_path: Path) -> None:
    make(tmp_path)
    session, cause = ((tmp_path / n).read_text("utf-8") for n in ("terminal.svg", "cause.svg"))
    assert difference(words(stored("terminal.svg")), words(session)) == ""
    assert numbers(cause) == pytest.approx(numbers(stored("cause.svg")), abs=5.0)  # of 460 points
