"""The gallery shows every verb, and no path of the machine that made it."""

from __future__ import annotations

import re

import pytest
import typer

from heli3dof.cli.app import app
from tests.docs.gallery import (
    COLUMNS,
    EXAMPLES,
    LONGEST,
    PAGE,
    PHOTOGRAPHS,
    PICTURES,
    frames,
    page,
    picture,
)

VERBS = list(getattr(typer.main.get_command(app), "commands"))  # noqa: B009
MACHINE_PATH = re.compile(r"/(?:tmp|home|root|Users|work|var|opt|private)/|[A-Z]:\\")
MOST_BYTES, MOST_PHOTO_BYTES = 1.5e6, 0.7e6


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_an_entry_a_picture_and_a_heading(verb: str) -> None:
    assert any(f"heli3dof {verb}" in command for command in EXAMPLES[verb].commands)
    assert (PICTURES / "verbs" / f"{verb}.svg").exists()
    assert f"\n## {verb}\n" in PAGE.read_text(encoding="utf-8")


def test_the_page_is_todays() -> None:
    assert PAGE.read_text(encoding="utf-8") == page()


def test_no_picture_shows_a_path_of_the_machine_that_made_it() -> None:
    svgs = sorted((PICTURES / "verbs").glob("*.svg"))
    assert {svg.stem for svg in svgs} == set(EXAMPLES) == set(VERBS)
    for svg in svgs:
        assert not MACHINE_PATH.search(svg.read_text(encoding="utf-8").replace("&#160;", " ")), svg
    assert sum(svg.stat().st_size for svg in svgs) < MOST_BYTES


def test_the_report_is_shown_at_each_width_and_scheme() -> None:
    photos = [PICTURES / "report" / f"{scheme}-{width}.png" for scheme, width in PHOTOGRAPHS]
    assert sum(photo.stat().st_size for photo in photos) < MOST_PHOTO_BYTES


def test_a_long_output_is_cut_and_a_long_line_continues() -> None:
    assert picture("x", ["a"] * 100).count(">a</text>") == LONGEST - 1
    assert "…" in picture("x", ["a"] * 100)
    assert picture("x", ["b" * (COLUMNS + 5)]).count(">bbbbb</text>") == 1


def test_a_live_view_has_a_screen_for_each_frame() -> None:
    stream = "start\r\n1 s\r\nroll\r\x1b[2K\x1b[1A\x1b[2K2 s\r\nroll\r\n"
    assert next(iter(frames(stream))) == ["start", "1 s", "roll"]
    assert list(frames(stream))[-1] == ["start", "2 s", "roll"]
