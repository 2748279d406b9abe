"""`Grid`: a table of strings, rendered for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, Group, RenderResult
    from rich.table import Table

GAP = 2
"""Number of spaces between columns on a terminal, as the library rich draws a table"""


NAME = 20
"""Number of characters up to which a cell of text stays on one line (a convention)"""


@dataclass(frozen=True)
class Grid:
    """A table of strings. Columns of numbers (`is_number`) align right, all others left."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Sequence[str] = ()
    text_columns: int = 1
    """Number of columns at the left end that contain text; a narrow terminal repeats them"""
    prose_columns: int = 0
    """Number of columns at the right end that contain sentences; they align left too"""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"{self.title}: {len(row)} cells in {len(self.columns)} columns")

    def is_number(self, column: int) -> bool:
        """Return True if the column with this index (from 0) holds numbers, which align right."""
        return self.text_columns <= column < len(self.columns) - self.prose_columns

    @property
    def has_groups(self) -> bool:
        """Return True if the first column repeats names; the table then prints each name once."""
        first = [row[0] for row in self.rows]
        return len(set(first)) < len(first)

    def __rich__(self) -> Group:
        """Return the table and its notes as the library rich prints them on a terminal.

        If the table is wider than the terminal, rich prints it in parts, one below the other. Each
        part starts with the text columns (the first n columns, n = ``text_columns``). No word is
        broken.
        """
        from rich.console import Group
        from rich.text import Text

        notes = [Text(f"· {n}", style="dim") for n in self.notes]
        return Group(Text(self.title, style="bold"), _FittingTable(self), *notes)


class _FittingTable:
    """The column titles and rows of a `Grid`, as an object that the library ``rich`` can print.

    If the table is wider than the terminal, ``rich`` prints it in parts, one below the other.
    """

    def __init__(self, grid: Grid) -> None:
        self.grid = grid

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for columns in self._parts(options.max_width):
            yield self._table(columns, options.max_width)

    def _parts(self, width: int) -> list[list[int]]:
        """Return the table's columns, divided into parts of at most ``width`` characters.

        Each part has all text columns, and as many of the others as fit.
        """
        least = [self._least_width(i) + GAP for i in range(len(self.grid.columns))]
        always = list(range(self.grid.text_columns))
        parts, room = [list(always)], width - sum(least[i] for i in always)
        left = room
        for i in range(self.grid.text_columns, len(least)):
            if least[i] > left + GAP and len(parts[-1]) > len(always):
                parts.append(list(always))
                left = room
            parts[-1].append(i)
            left -= least[i]
        return parts

    def _least_width(self, column: int) -> int:
        """Return the width in characters of a column's longest cell or title.

        A text of more than `NAME` characters can be wrapped, so only its longest word counts.
        """
        from rich.cells import cell_len

        cells = [row[column] for row in self.grid.rows]
        if not self.grid.is_number(column):
            cells = [c for cell in cells for c in ([cell] if len(cell) <= NAME else cell.split())]
        return max(map(cell_len, (*self._head(column), *cells)), default=0)

    def _head(self, column: int) -> list[str]:
        """Return a column's title in lines; in a column of numbers, the unit has its own line."""
        head = self.grid.columns[column]
        return head.rsplit(" ", 1) if self.grid.is_number(column) else [head]

    def _widths(self, columns: Sequence[int], width: int) -> list[int]:
        """Return the widths of ``columns`` in characters, together at most ``width`` if possible.

        Each column first gets its least width. The characters that remain go to the columns from
        left to right, to each at most as many as its longest line needs.
        """
        from rich.cells import cell_len

        widths = [self._least_width(i) for i in columns]
        left = width - sum(widths) - GAP * len(columns)
        for n, i in enumerate(columns):
            lines = [line for row in self.grid.rows for line in row[i].splitlines()]
            wanted = max(map(cell_len, lines), default=0) - widths[n]
            more = max(0, min(wanted, left))
            widths[n] += more
            left -= more
        return widths

    def _table(self, columns: Sequence[int], width: int) -> Table:
        from rich import box
        from rich.table import Table
        from rich.text import Text

        # One space of padding per column, so that wide tables fit into 80 characters.
        table = Table(
            box=box.SIMPLE_HEAD,
            padding=(0, 1, 0, 0),
            pad_edge=False,
            show_edge=False,
            header_style="bold",
        )
        height = max(len(self._head(i)) for i in columns)
        for i, its_width in zip(columns, self._widths(columns, width), strict=True):
            number = self.grid.is_number(i)
            head = self._head(i)
            above = [] if number else [""] * (height - len(head))
            table.add_column(
                Text("\n".join([*above, *head])),
                justify="right" if number else "left",
                no_wrap=number,
                width=its_width,
                overflow="fold",
            )
        before: Sequence[str] = ()
        for row in self.grid.rows:
            if before and row[0] != before[0] and self.grid.has_groups:
                table.add_row()
            shown = list(row)
            if before and row[0] == before[0] and self.grid.has_groups:
                shown[0] = ""
            table.add_row(*(Text(shown[i]) for i in columns))
            before = row
        return table
