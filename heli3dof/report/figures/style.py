"""The style of all figures, and their output as SVG, PNG or PDF.

The same data give the same file, byte for byte. The colours (Okabe and Ito) are distinct for
colour-blind readers; line styles differ too, for grey prints. matplotlib is imported inside the
functions, because its import takes half a second.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heli3dof.errors import UsageError
from heli3dof.recording.atomic_write import check_outputs, write_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INK = "#1f2328"
SOFT = "#6e7781"
GRID = "#e4e7eb"
VERMILION, BLUE, GREEN = "#D55E00", "#0072B2", "#009E73"
PURPLE, ORANGE, SKY = "#CC79A7", "#E69F00", "#56B4E9"
TITLE_WIDTH = 74
"""Largest number of characters in a title"""
SYMBOLS = {"roll": "r", "pitch": "p", "yaw": "ψ"}
"""Axis → symbol of its angle in labels"""
FORMATS: dict[str, dict[str, Any]] = {
    ".svg": {"metadata": {"Date": None, "Creator": "heli3dof"}},
    ".png": {"metadata": {"Software": "heli3dof"}, "dpi": 150},
    ".pdf": {"metadata": {"CreationDate": None, "Creator": "heli3dof", "Producer": None}},
}
"""Ending → options of matplotlib's savefig; without dates, and PNG at 150 dots per inch"""

RC: Any = {
    "font.family": "DejaVu Sans",  # part of matplotlib, so the layout is the same everywhere
    "font.size": 9.5,
    "text.color": INK,
    "axes.edgecolor": SOFT,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "lines.solid_capstyle": "round",
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
    "svg.hashsalt": "heli3dof",
    "svg.fonttype": "path",
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


@dataclass(frozen=True)
class Line:
    """The style of one curve: colour, line width (points), dash pattern, drawing order ``z``."""

    color: str
    width: float
    dash: tuple[float, ...] = ()
    z: int = 3

    def kwargs(self) -> dict[str, Any]:
        """Return the style as keyword arguments of matplotlib's ``Axes.plot``."""
        style: Any = (0, self.dash) if self.dash else "-"
        return {
            "color": self.color,
            "linewidth": self.width,
            "linestyle": style,
            "zorder": self.z,
        }


REFERENCE = Line(SOFT, 1.1, (4, 2), 2)
# The models' thin lines are above this broad dark one: where they agree, both are visible.
EXPERIMENT = Line(INK, 2.5, (), 3)
MEASURED = Line(INK, 1.5, (), 3)
EXTENDED = Line(BLUE, 1.6, (), 6)
"""Line of a model extended by the causes of a diagnosis"""
HOVER = Line(VERMILION, 1.6, (6, 1.5), 5)
HOVER_PRINTED = Line(ORANGE, 1.6, (1.5, 1.5), 5)
IDENTIFIED = (
    Line(BLUE, 1.6, (), 6),
    Line(GREEN, 1.6, (8, 1.5, 1.5, 1.5), 6),
    Line(PURPLE, 1.6, (3, 1), 6),
    Line(SKY, 1.6, (10, 2), 6),
)


def plain(text: str, most: int = 200) -> str:
    """Return ``text`` cut to ``most`` characters and with each $ escaped for matplotlib."""
    if len(text) > most:
        text = text[: most - 1] + "…"
    return text.replace("$", r"\$")


def model_lines(kinds: list[str]) -> list[Line]:
    """Return a line style for each model kind. The hover model has the same one in all figures."""
    lines: list[Line] = []
    identified = 0
    for kind in kinds:
        if kind == "hover" and HOVER not in lines:
            lines.append(HOVER)
        elif kind == "hover_printed" and HOVER_PRINTED not in lines:
            lines.append(HOVER_PRINTED)
        else:
            lines.append(IDENTIFIED[identified % len(IDENTIFIED)])
            identified += 1
    return lines


@contextmanager
def new_figure(width: float, height: float, title: str) -> Iterator[Figure]:
    """Context manager: yield a figure of ``width`` × ``height`` inches with a title, to draw on."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(RC):
        figure = Figure(figsize=(width, height))
        text = plain(title, TITLE_WIDTH)
        figure.text(0.015, 1 - 0.21 / height, text, fontsize=11.5, fontweight="bold", va="center")
        yield figure


def to_svg(figure: Figure) -> str:
    """Return the figure as SVG text."""
    return drawn(figure, ".svg").decode("utf-8")


def drawn(figure: Figure, ending: str) -> bytes:
    """Return the content of the figure's file; ``ending``, such as ``.svg``, states the format."""
    import matplotlib

    buffer = io.BytesIO()
    with matplotlib.rc_context(RC):
        figure.savefig(buffer, format=ending[1:], **FORMATS[ending])
    return buffer.getvalue()


def check_ending(path: Path) -> None:
    """Raise UsageError unless the path ends with ``.svg``, ``.png`` or ``.pdf``."""
    if path.suffix not in FORMATS:
        raise UsageError(
            f"A figure cannot be written as {path.name!r}.",
            cause="figures are SVG, PNG or PDF.",
            fix=f"use {', '.join(path.with_suffix(f).name for f in FORMATS)}",
        )


def save(figure: Figure, path: str | Path, *, force: bool = False) -> Path:
    """Write the figure as ``.svg``, ``.png`` or ``.pdf``, by the path's ending; return the path.

    Raises OutputExists if the file exists, unless ``force``. Raises UsageError for another ending.
    """
    path = Path(path)
    check_ending(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    check_outputs(path, force=force)  # before drawing, which takes a second
    return write_file(path, drawn(figure, path.suffix), force=force)
