"""Convert a matplotlib figure for the HTML page: a static picture, and the data of a live figure.

The picture is an SVG image whose colours follow the reader's light or dark theme. The data hold the
figure's panels with curves, bands and axes as JSON values; ``pages/assets/figures.js`` draws them
with uPlot, so that a reader can zoom and read values. Picture and live figure show the same.

A curve of more than `MOST_SAMPLES` samples is divided into buckets. Each bucket keeps its least and
greatest sample, so no peak is lost, and its first NaN, which interrupts the curve.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from math import isfinite
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np

from heli3dof.report.figures import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_SAMPLES = 2000
"""Number of samples above which a curve is decimated; bounds it to about 30 kB (a convention)"""
DIGITS = 6
"""Significant digits of a sample: they resolve 1 ms in a quarter of an hour, and 0.001° in 720°"""
THEME = {
    "ink": (style.INK, "#e6edf3"),
    "faint": (style.SOFT, "#8d96a0"),
    "grid": (style.GRID, "#30363d"),
    "paper": ("#ffffff", "#0d1117"),
    "vermilion": (style.VERMILION, "#ff8c42"),
    "blue": (style.BLUE, "#58b4f0"),
    "green": (style.GREEN, "#2fc99a"),
    "purple": (style.PURPLE, "#dd9cc0"),
    "orange": (style.ORANGE, "#f2b53c"),
    "sky": (style.SKY, "#8ad0f7"),
}
"""CSS variable → colour of the figures on a light page, colour on a dark page"""


def theme_css() -> str:
    """Return CSS that defines the variables of `THEME` for light and dark pages."""
    light, dark = (
        "".join(f"--{name}:{both[i]};" for name, both in THEME.items()) for i in range(2)
    )
    return f":root{{{light}}}@media screen and (prefers-color-scheme:dark){{:root{{{dark}}}}}"


def svg_address(figure: Figure) -> str:
    """Return the figure as an SVG image in a ``data:`` URL.

    The image contains light and dark colours; the browser chooses those of the reader's theme.
    """
    svg = style.to_svg(figure)
    svg = svg[svg.index("<svg") :]  # without XML declaration and document type
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"[1-9]\d*\.\d{3,}", lambda m: f"{float(m[0]):.2f}", svg)  # to 0.01 points
    for name, (light, _) in THEME.items():
        svg = re.sub(re.escape(light), f"var(--{name})", svg, flags=re.IGNORECASE)
    svg = svg.replace("<defs>", f"<style>{theme_css()}</style><defs>", 1)
    return "data:image/svg+xml," + quote(re.sub(r"\s+", " ", svg), safe=" '()*+,-./:;=?@_!~{}")


def live_data(figure: Figure) -> dict[str, Any]:
    """Return the figure's texts, its number of columns, and its panels, as JSON values."""
    axes = [a for a in figure.axes if a.axison]
    spec = axes[0].get_subplotspec()
    return {
        "texts": [t.get_text().replace(r"\$", "$") for t in figure.texts],
        "columns": 1 if spec is None else spec.get_gridspec().ncols,
        "panels": [_panel(a, axes) for a in axes],
    }


def _panel(axes: Any, all_axes: Sequence[Any]) -> dict[str, Any]:
    """Return one panel as JSON values: labels, ranges, curves, bands and shaded spans.

    ``axes``: the panel's Matplotlib object Axes; ``all_axes``: the objects of all panels, including
    this one. If several panels share a label, only one of their objects contains it. The function
    returns such a label for each of these panels.
    """
    siblings = [a for a in all_axes if a is axes or axes.get_shared_x_axes().joined(axes, a)]
    row = [axes, *(a for a in siblings if _in_one(a, axes, "row"))]
    column = [axes, *(a for a in all_axes if _in_one(a, axes, "col"))]
    return {
        "title": next((a.get_title(loc="left") for a in column if a.get_title(loc="left")), ""),
        "x": next((a.get_xlabel() for a in siblings if a.get_xlabel()), ""),
        "y": next((a.get_ylabel() for a in row if a.get_ylabel()), ""),
        "log": axes.get_xscale() == "log",
        "xlim": _numbers(axes.get_xlim()),
        "ylim": _numbers(axes.get_ylim()),
        "link": all_axes.index(siblings[0]),
        "curves": [*_error_bars(axes), *_lines(axes), *_stems(axes)],
        "bands": list(_bands(axes)),
        "spans": list(_spans(axes)),
    }


def _in_one(a: Any, b: Any, what: str) -> bool:
    """Return True if two axes are in the same row or column (``what``: ``row``, ``col``)."""
    one, other = a.get_subplotspec(), b.get_subplotspec()
    return bool(one and other and getattr(one, f"{what}span") == getattr(other, f"{what}span"))


def _lines(axes: Any) -> Iterable[dict[str, Any]]:
    points = {id(c.lines[0]) for c in axes.containers}
    for line in axes.lines:
        if line.get_label().startswith(("_child", "_nolegend_")) or id(line) in points:
            continue  # a mark, a zero line, the cap of an error bar
        x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
        rows = decimated(y.astype(float))
        yield {
            "name": line.get_label(),
            "color": variable_of(line.get_color()),
            "width": line.get_linewidth(),
            "dash": list(line._dash_pattern[1] or ()),
            "x": _numbers(x[rows]),
            "y": _numbers(y[rows]),
        }


def _error_bars(axes: Any) -> Iterable[dict[str, Any]]:
    for container in axes.containers:
        points, _, (bars, *_) = container.lines
        ends = np.array([segment[:, 1] for segment in bars.get_segments()])
        yield {
            "name": container.get_label(),
            "color": variable_of(points.get_color()),
            "kind": "points",
            "x": _numbers(points.get_xdata()),
            "y": _numbers(points.get_ydata()),
            "error": _numbers(np.diff(ends)[:, 0] / 2),
        }


def _stems(axes: Any) -> Iterable[dict[str, Any]]:
    error_bars = {id(bars) for c in axes.containers for bars in c.lines[2]}
    for stems in axes.collections:
        if not hasattr(stems, "get_segments") or id(stems) in error_bars:
            continue
        tops = np.array([segment[-1] for segment in stems.get_segments()])
        yield {
            "name": stems.get_label(),
            "color": variable_of(stems.get_color()[0]),
            "kind": "stems",
            "x": _numbers(tops[:, 0]),
            "y": _numbers(tops[:, 1]),
        }


def _bands(axes: Any) -> Iterable[dict[str, Any]]:
    """Yield each band of ``fill_between`` as a polygon: along one edge, back along the other."""
    for band in axes.collections:
        if hasattr(band, "get_segments"):
            continue
        for path in band.get_paths():
            x, y = path.vertices.T
            yield {
                "color": variable_of(band.get_facecolor()[0][:3]),
                "x": _numbers(x),
                "y": _numbers(y),
            }


def _spans(axes: Any) -> Iterable[dict[str, Any]]:
    """Yield each shaded interval of the horizontal (``axvspan``) or vertical axis (``axhspan``)."""
    for patch in axes.patches:
        x, y = patch.get_bbox().get_points().T
        over_x = y.tolist() == [0, 1]
        ends = x if over_x else y
        yield {"axis": "x" if over_x else "y", "ends": _numbers(ends)}


def variable_of(color: Any) -> str:
    """Return the CSS variable (key of `THEME`) of a colour of the figure style."""
    from matplotlib.colors import to_hex

    code = to_hex(color)
    return next(name for name, (light, _) in THEME.items() if light.lower() == code)


def decimated(y: np.ndarray, most: int = MOST_SAMPLES) -> np.ndarray:
    """Return sorted indices of about ``most`` samples of a curve ``y`` that keep its shape.

    Both ends are kept too, so there can be a few more indices than ``most``.

    >>> decimated(np.array([0.0, 0.0, 9.0, 0.0, 0.0, 0.0, -9.0, 0.0]), 4).tolist()
    [0, 2, 4, 6, 7]
    """
    n = len(y)
    if n <= most:
        return np.arange(n)
    buckets = max(1, most // 2)
    size = -(-n // buckets)
    parts = np.append(y, np.full(-n % size, y[-1])).reshape(-1, size)
    start = size * np.arange(len(parts))
    broken = np.isnan(parts)
    has_nan, has_value = broken.any(axis=1), ~broken.all(axis=1)
    least = start + np.where(broken, np.inf, parts).argmin(axis=1)
    greatest = start + np.where(broken, -np.inf, parts).argmax(axis=1)
    first_nan = start + broken.argmax(axis=1)
    return np.unique(
        np.concatenate([[0, n - 1], least[has_value], greatest[has_value], first_nan[has_nan]])
    )


def _numbers(values: Any) -> list[float | None]:
    """Return numbers with `DIGITS` significant digits; None for NaN, which JSON lacks."""
    flat = np.asarray(values, dtype=float).tolist()
    return [float(f"{v:.{DIGITS}g}") if isfinite(v) else None for v in flat]
