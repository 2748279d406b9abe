"""Draw the last seconds of the three angles as traces of braille dots in a terminal.

A character holds 2 × 4 dots. The angle is a solid cyan line, the reference is dotted and yellow.
"""

from __future__ import annotations

from array import array
from collections import deque
from collections.abc import Sequence
from itertools import groupby
from math import nan
from operator import itemgetter
from typing import TYPE_CHECKING

from heli3dof.axes import AXES
from heli3dof.cli.output_encoding import is_ascii_or_utf
from heli3dof.errors import minus

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

WIDTH, HEIGHT = 80, 24
"""Columns and lines of the smallest terminal in which traces are drawn"""
WINDOW_S = 15.0
ROWS = 4  # of characters, for each axis
LABEL = 9  # characters left of a trace: the highest and the lowest angle of its scale
MIN_SPAN_DEG = 1.0
"""Smallest range of a trace's scale: a few steps of an encoder, so that noise does not fill it"""
PER_SECOND = 10.0
DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bit of each dot in a braille character: four rows of two dots"""
BRAILLE = 0x2800


def fits(console: Console) -> bool:
    """Return True if the console is large enough for traces and its encoding has braille."""
    width, height = console.size
    return width >= WIDTH and height >= HEIGHT and is_ascii_or_utf(chr(BRAILLE), console.encoding)


class Traces:
    """Collects angles and references, and draws those of the last `WINDOW_S` seconds."""

    def __init__(self) -> None:
        self._points: deque[array[float]] = deque(maxlen=round(PER_SECOND * WINDOW_S))
        """Points [t (s), three angles (°), three references (°)] of the last `WINDOW_S` seconds"""

    def add(
        self, t: float, angle_deg: Sequence[float], reference_deg: Sequence[float] = (nan, nan, nan)
    ) -> None:
        """Add the angles (3,) and references (3,), in degrees, at the time ``t`` (s)."""
        self._points.append(array("d", (t, *angle_deg, *reference_deg)))

    def draw(self, heads: Sequence[str], width: int) -> list[Text]:
        """Return the lines to print: for each axis a heading from ``heads``, then the axis's trace.

        ``width``: characters of a line.
        """
        from rich.text import Text

        end = self._points[-1][0] if self._points else 0.0
        points = [p for p in self._points if p[0] >= end - WINDOW_S]
        dots = 2 * (width - LABEL)
        x = [round((p[0] - end + WINDOW_S) / WINDOW_S * (dots - 1)) for p in points]
        lines = []
        for i, head in zip(range(len(AXES)), heads, strict=True):
            angle, reference = [p[1 + i] for p in points], [p[4 + i] for p in points]
            low, high = scale([*angle, *reference])
            lines.append(Text(minus(head)))
            trace = drawn(x, dot_rows(angle, low, high), dot_rows(reference, low, high), dots // 2)
            trace[0] = Text(minus(f"{high:+7.1f}° "), "dim") + trace[0]
            trace[-1] = Text(minus(f"{low:+7.1f}° "), "dim") + trace[-1]
            lines += [trace[0], *(Text(" " * LABEL) + line for line in trace[1:-1]), trace[-1]]
        return lines


def scale(values: Sequence[float]) -> tuple[float, float]:
    """Return (lowest, highest) finite value; values closer than `MIN_SPAN_DEG` are moved apart.

    >>> scale([2.0, nan, 2.2])
    (1.6, 2.6)
    """
    finite = [v for v in values if v == v] or [0.0]
    low, high = min(finite), max(finite)
    missing = max(0.0, MIN_SPAN_DEG - (high - low))
    return low - missing / 2, high + missing / 2


def dot_rows(values: Sequence[float], low: float, high: float) -> list[int | None]:
    """Return, for each value, the index of the row of dots that shows it; None for NaN.

    Row 0, the top, shows ``high``; the bottom row shows ``low``.
    """
    last = 4 * ROWS - 1
    return [None if v != v else round((high - v) / (high - low) * last) for v in values]


def drawn(
    x: Sequence[int], angle: Sequence[int | None], reference: Sequence[int | None], width: int
) -> list[Text]:
    """Return `ROWS` lines of ``width`` braille characters that show an angle and its reference.

    ``x``: for each point, the index of its column of dots. ``angle``, ``reference``: for each
    point, the index of the row of dots that shows the value; None for a missing value.
    """
    from rich.text import Text

    cells = [[0] * width for _ in range(ROWS)]
    is_angle = [[False] * width for _ in range(ROWS)]

    def dot(column: int, row: int) -> tuple[int, int]:
        cells[row // 4][column // 2] |= DOTS[row % 4][column % 2]
        return row // 4, column // 2

    for column, row in zip(x, reference, strict=True):
        if row is not None and column % 2:
            dot(column, row)
    before: int | None = None
    for column, row in zip(x, angle, strict=True):
        if row is not None:
            start = row if before is None else before + (row > before) - (row < before)
            for each in range(min(start, row), max(start, row) + 1):
                r, c = dot(column, each)
                is_angle[r][c] = True
        before = row
    lines = []
    for bits, styles in zip(cells, is_angle, strict=True):
        runs = groupby(zip(styles, bits, strict=True), key=itemgetter(0))
        line = Text()
        for of_angle, run in runs:
            dots = "".join(chr(BRAILLE + each) for _, each in run)
            line.append(dots, "cyan" if of_angle else "yellow")
        lines.append(line)
    return lines
