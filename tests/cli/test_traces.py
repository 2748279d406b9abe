"""Traces of braille dots: scale, dots, connection, and when there is room for them."""

from __future__ import annotations

from math import nan

from heli3dof.cli.traces import LABEL, ROWS, WINDOW_S, Traces, dot_rows, drawn, scale


def text_of(traces: Traces, axis: int, width: int = 30) -> list[str]:
    lines = [line.plain for line in traces.draw(["r", "p", "y"], width)]
    return lines[axis * (ROWS + 1) : (axis + 1) * (ROWS + 1)]


def test_the_highest_angle_is_in_the_top_row_of_dots() -> None:
    assert dot_rows([0.0, 1.0, nan, 0.5], 0.0, 1.0) == [15, 0, None, 8]


def test_one_dot_is_one_bit_of_a_braille_character() -> None:
    assert [line.plain for line in drawn([1], [6], [None], 1)] == ["⠀", "⠠", "⠀", "⠀"]


def test_a_jump_of_the_angle_is_a_connected_line() -> None:
    columns = drawn([0, 1], [0, 15], [None, None], 1)
    assert [line.plain for line in columns] == ["⢱", "⢸", "⢸", "⢸"]


def test_a_steady_angle_has_a_scale_around_it() -> None:
    assert scale([2.0, 2.0]) == (1.5, 2.5)
    assert scale([nan]) == (-0.5, 0.5)


def test_the_labels_are_the_largest_and_smallest_of_angle_and_reference() -> None:
    traces = Traces()
    traces.add(0.0, (0.0, 0.0, 0.0), (10.0, 0.0, 0.0))
    traces.add(1.0, (-5.0, 0.0, 0.0), (10.0, 0.0, 0.0))
    head, *rows = text_of(traces, 0)
    assert head == "r"
    assert rows[0].startswith("  +10.0° ")
    assert rows[-1].startswith("   −5.0° ")
    assert {len(row) for row in rows} == {30}


def test_points_older_than_the_window_are_left_out() -> None:
    traces = Traces()
    traces.add(0.0, (50.0, 0.0, 0.0))
    traces.add(WINDOW_S + 1, (0.0, 0.0, 0.0))
    rows = text_of(traces, 0)[1:]
    assert "50.0" not in rows[0]
    assert [row[LABEL:-1].strip("⠀") for row in rows] == [""] * ROWS


def test_no_points_give_empty_traces() -> None:
    assert text_of(Traces(), 2)[0] == "y"
