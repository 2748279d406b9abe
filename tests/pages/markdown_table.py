"""Renders a `Grid` in Markdown."""

from __future__ import annotations

from heli3dof.report.text.table import Grid


def to_markdown(grid: Grid) -> str:
    """Return the table in Markdown, with a bold title and the notes as a list."""
    lines = [f"**{_md(grid.title)}**", ""]
    lines.append("| " + " | ".join(_md(c) for c in grid.columns) + " |")
    marks = ["--:" if grid.is_number(i) else ":--" for i in range(len(grid.columns))]
    lines.append("| " + " | ".join(marks) + " |")
    lines += ["| " + " | ".join(_md(c) for c in row) + " |" for row in grid.rows]
    if grid.notes:
        lines += ["", *(f"- {_md(n)}" for n in grid.notes)]
    return "\n".join(lines) + "\n"


def _md(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
