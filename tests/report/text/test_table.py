from __future__ import annotations

import io

import pytest
from rich.console import Console

from heli3dof.report.pages.html import table
from heli3dof.report.text.table import Grid
from tests.pages.markdown_table import to_markdown

GRID = Grid(
    "Peaks",
    ["axis", "model", "peak °"],
    [["roll", "hover", "11.75"], ["roll", "<b>|x|", "−1.00"], ["yaw", "hover", "–"]],
    notes=["what they are"],
    text_columns=2,
)


def shown(grid: Grid, width: int = 80) -> str:
    out = io.StringIO()
    Console(file=out, width=width, no_color=True).print(grid)
    return out.getvalue()


def test_a_terminal_table_holds_every_cell_and_names_a_group_once() -> None:
    text = shown(GRID)
    assert text.count("roll") == 1
    for cell in ("Peaks", "hover", "<b>|x|", "11.75", "−1.00", "what they are"):
        assert cell in text


def test_markup_in_a_name_is_printed_as_text() -> None:
    text = shown(
        Grid("[red]t[/red]", ["a", "b"], [["[bold]x[/bold]", "1"]], notes=["[dim]n[/dim]"])
    )
    assert "[red]t[/red]" in text
    assert "[bold]x[/bold]" in text
    assert "[dim]n[/dim]" in text


def test_markdown_escapes_the_column_mark_and_aligns_numbers_right() -> None:
    lines = to_markdown(GRID).splitlines()
    assert lines[2] == "| axis | model | peak ° |"
    assert lines[3] == "| :-- | :-- | --: |"
    assert lines[5] == r"| roll | <b>\|x\| | −1.00 |"


def test_html_escapes_every_text() -> None:
    text = table(GRID)
    assert "<b>" not in text
    assert "&lt;b&gt;|x|" in text
    assert '<td class="n">11.75</td>' in text


def test_a_row_of_the_wrong_length_is_refused() -> None:
    with pytest.raises(ValueError, match="2 cells in 3 columns"):
        Grid("t", ["a", "b", "c"], [["1", "2"]])


WIDE = Grid(
    "Fits",
    ["recording", "model", *(f"{h:g} s ahead" for h in (0.1, 0.5, 1, 3)), "closed-loop replay"],
    [["step-roll-10", "identification", *["12.345°"] * 5], ["step-roll-10", "hover", *["–"] * 5]],
    text_columns=2,
)


@pytest.mark.parametrize("width", [48, 60, 80])
def test_a_terminal_table_breaks_no_word_and_fits_the_width(width: int) -> None:
    text = shown(WIDE, width)
    assert max(map(len, text.splitlines())) <= width
    assert text.count("12.345°") == 5
    assert "identification" in text
    assert "…" not in text


def test_a_table_that_is_too_wide_repeats_its_columns_of_text_below() -> None:
    assert shown(WIDE, 80).count("identification") == 1
    assert shown(WIDE, 48).count("identification") > 1
