"""Write a self-contained HTML page: questions with answers at the top, then sections of blocks.

The page links to no other file. Its figures are SVG images; where scripts run, a reader can zoom
them and read values (`heli3dof.report.figures.web`). A block is a string of HTML, with special
characters escaped.
"""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np

from heli3dof.recording.atomic_write import write_file
from heli3dof.report.figures.web import live_data, svg_address, theme_css, variable_of
from heli3dof.report.text.number_format import fixed
from heli3dof.report.text.table import Grid

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = Template("""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="heli3dof">
<title>$title</title>
<style>
$css
</style>
</head>
<body>
<header><h1>$title</h1><p class="subtitle">$subtitle</p>$contents</header>
<main>
$answers
$body
</main>
<footer>$footer</footer>
$script
</body>
</html>
""")
FILES = Path(__file__).with_name("assets")
"""Style sheet and script of the page, and uPlot (MIT licence), which draws the live figures"""


OPTION = re.compile(r"--[a-z-]+")


@dataclass(frozen=True)
class Answer:
    """A question at the top of an HTML page, with its answer: a sentence and a picture."""

    question: str
    """Plain text"""
    sentence: str
    """Plain text"""
    picture: str = ""
    """HTML; empty: no picture"""


@dataclass(frozen=True)
class Section:
    """A section of an HTML page: heading (plain text), and blocks (strings of HTML).

    The strings in ``blocks`` are always visible; those in ``details`` open by a click.
    """

    title: str
    blocks: Sequence[str] = ()
    details: Sequence[str] = ()


def paragraph(text: str) -> str:
    """Return plain text as an HTML paragraph that has no line break inside an option's name."""
    kept = OPTION.sub(r'<span class="option">\g<0></span>', html.escape(text))
    return f"<p>{kept}</p>"


def subheading(text: str) -> str:
    """Return plain text as an HTML heading inside a section."""
    return f"<h3>{html.escape(text)}</h3>"


def key(text: str) -> str:
    """Return plain text as a highlighted HTML paragraph."""
    return f'<p class="key">{html.escape(text)}</p>'


def warning(text: str) -> str:
    """Return plain text as an HTML paragraph in the style of a warning."""
    return f'<p class="warning">{html.escape(text)}</p>'


def table(grid: Grid) -> str:
    """Return a table as HTML: its title as the caption, its cells, and its notes as a list.

    Special characters in all these texts are escaped.
    """
    heads = "".join(
        f'<th scope="col"{_css(grid, i)}>{html.escape(c)}</th>' for i, c in enumerate(grid.columns)
    )
    body, before = [], None
    for row in grid.rows:
        opens = grid.has_groups and row[0] != before
        cells = []
        for i, cell in enumerate(row):
            text = "" if i == 0 and grid.has_groups and not opens else html.escape(cell)
            cells.append(f"<td{_css(grid, i)}>{text}</td>")
        # A row with an indented name belongs to the row above.
        aside = any(cell.startswith("  ") for cell in row)
        classes = " ".join(c for c, on in (("opens", opens), ("aside", aside)) if on)
        row_class = f' class="{classes}"' if classes else ""
        body.append(f"<tr{row_class}>{''.join(cells)}</tr>")
        before = row[0]
    notes = "".join(f"<li>{html.escape(n)}</li>" for n in grid.notes)
    return (
        f'<div class="table"><table><caption>{html.escape(grid.title)}</caption>'
        f"<thead><tr>{heads}</tr></thead><tbody>{''.join(body)}</tbody></table></div>"
        + (f'<ul class="notes">{notes}</ul>' if notes else "")
    )


def _css(grid: Grid, column: int) -> str:
    if grid.is_number(column):
        return ' class="n"'
    return ' class="t"' if column < grid.text_columns else ""


def facts(values: Mapping[str, Any]) -> str:
    """Return an HTML list with a line per pair (name, value); a value None is left out."""
    rows = "".join(
        f"<dt>{html.escape(str(name))}</dt><dd>{html.escape(str(value))}</dd>"
        for name, value in values.items()
        if value is not None
    )
    return f"<dl>{rows}</dl>"


def listing(value: Any) -> str:
    """Return ``value`` (nested dicts and lists) as indented JSON in an HTML block."""
    text = json.dumps(value, ensure_ascii=False, indent=1, default=str)
    return f"<pre>{html.escape(text)}</pre>"


def bars(
    groups: Mapping[str, Mapping[str, float]], styles: Mapping[str, str], title: str, alt: str
) -> str:
    """Return groups of horizontal bars, each labelled with its value in degrees.

    ``groups``: group → name → value, NaN for no bar; ``styles``: name → colour of the figure style;
    ``title``: the quantity, before the legend; ``alt``: alternative text.
    """
    colors = {name: f"background:var(--{variable_of(color)})" for name, color in styles.items()}
    known = [(n, v) for values in groups.values() for n, v in values.items() if np.isfinite(v)]
    drawn = [(n, c) for n, c in colors.items() if n in dict(known)]
    legend = "".join(f'<i style="{c}"></i>{html.escape(n)} ' for n, c in drawn)
    longest = max((v for _, v in known), default=0.0) or 1.0
    rows = "".join(
        f"<b>{html.escape(group)}</b><div>"
        + "".join(
            f'<span><i style="{colors[name]};width:{80 * v / longest:.1f}%"></i>'
            f"{fixed(v, 2, '°')}</span>"
            for name, v in values.items()
            if np.isfinite(v)
        )
        + "</div>"
        for group, values in groups.items()
    )
    return (
        f'<figure class="bars" role="img" aria-label="{html.escape(alt, quote=True)}">'
        f"<p>{html.escape(title)}: {legend}</p>{rows}</figure>"
    )


def figure(drawn: Figure, alt: str, *, flight: str = "") -> str:
    """Return a figure that a reader can zoom, with its SVG image for readers without scripts.

    ``flight``: identifies the recording; figures of the same recording zoom together in time.
    """
    values = {**live_data(drawn), "flight": flight}
    data = json.dumps(values, ensure_ascii=False, separators=(",", ":"))
    data = data.replace("<", "\\u003c")  # no text can end the script element
    image = f'<img alt="{html.escape(alt, quote=True)}" src="{svg_address(drawn)}">'
    return f'<figure>{image}<script type="application/json">{data}</script></figure>'


def page(
    title: str,
    subtitle: str,
    sections: Iterable[Section],
    *,
    answers: Sequence[Answer] = (),
    footer: str = "",
) -> str:
    """Return a complete HTML page: ``answers`` at the top, then ``sections``.

    ``title``, ``subtitle``, ``footer``: plain text.
    """
    sections = [s for s in sections if s.blocks or s.details]
    links = "".join(
        f'<a href="#s{i}">{html.escape(s.title)}</a>' for i, s in enumerate(sections, 1)
    )
    shown = "".join(
        f"<article><h2>{html.escape(a.question)}</h2>{paragraph(a.sentence)}{a.picture}</article>"
        for a in answers
    )
    body = "\n".join(
        f'<section id="s{i}"><h2>{html.escape(s.title)}</h2>{"".join(s.blocks)}'
        f"{_folded(s.details)}</section>"
        for i, s in enumerate(sections, 1)
    )
    licence = f"/* uPlot\n{_file('uPlot-LICENSE.txt')}\n*/"
    scripts = "\n".join([licence, _file("uPlot.iife.min.js"), _file("figures.js")])
    live = '<script type="application/json">' in body + shown
    return PAGE.substitute(
        title=html.escape(title),
        subtitle=html.escape(subtitle),
        css="\n".join([theme_css(), *(_file(n) for n in ("uPlot.min.css", "report.css"))]),
        contents=f'<nav aria-label="Sections">{links}</nav>' if len(sections) > 1 else "",
        answers=f'<div class="answers">{shown}</div>' if shown else "",
        body=body,
        footer=html.escape(footer),
        script=f"<script>\n{scripts}\n</script>" if live else "",
    )


def _folded(blocks: Sequence[str]) -> str:
    """Return blocks inside a <details> element whose summary counts their figures and tables."""
    if not blocks:
        return ""
    text = "".join(blocks)
    counts = [(text.count(f"<{tag}"), tag) for tag in ("figure", "table")]
    parts = [f"{n} {tag}{'s' if n > 1 else ''}" for n, tag in counts if n]
    summary = ": ".join(["Details", ", ".join(parts)] if parts else ["Details"])
    return f"<details><summary>{summary}</summary>{text}</details>"


def _file(name: str) -> str:
    return (FILES / name).read_text(encoding="utf-8")


def write_page(text: str, path: str | Path, *, force: bool = False) -> Path:
    """Write the HTML ``text`` to the file ``path``; return the path.

    Raises OutputExists if the file exists, unless ``force`` is true.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    return write_file(path, text.encode("utf-8"), force=force)
