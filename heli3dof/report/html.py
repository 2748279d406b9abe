"""Write a self-contained HTML page: sections of blocks, without scripts or external links.

Figures are embedded. A block is a string of HTML, with special characters escaped.
"""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

from heli3dof.recording.atomic_write import write_file
from heli3dof.report.figure_style import to_svg
from heli3dof.report.text_table import Grid, to_html

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
<header><p class="brand">heli3dof</p><h1>$title</h1><p class="lede">$subtitle</p>$contents</header>
<main>
$body
</main>
<footer>$footer</footer>
</body>
</html>
""")

CSS = """\
:root { --ink: #1f2328; --soft: #59636e; --line: #d8dee4; --wash: #f6f8fa; --accent: #0072b2;
  --warn: #9a3b00; --warn-wash: #fff4ec; }
* { box-sizing: border-box; }
html { color-scheme: light; }
body { margin: 0 auto; padding: 2.5rem 1.25rem 4rem; max-width: 60rem; color: var(--ink);
  background: #fff; font: 16px/1.55 system-ui, "Segoe UI", "Liberation Sans", Arial, sans-serif; }
header { border-bottom: 1px solid var(--line); margin-bottom: 2rem; padding-bottom: 1.25rem; }
.brand { margin: 0; color: var(--accent); font-weight: 600; letter-spacing: .02em; }
h1 { margin: .1rem 0 .4rem; font-size: 1.9rem; line-height: 1.2; overflow-wrap: anywhere; }
h2 { margin: 2.6rem 0 .6rem; font-size: 1.3rem; border-bottom: 1px solid var(--line);
  padding-bottom: .25rem; }
h3 { margin: 1.8rem 0 .4rem; font-size: 1.05rem; overflow-wrap: anywhere; }
p { margin: .5rem 0; }
.lede { color: var(--soft); font-size: 1.05rem; margin: 0; }
nav { margin-top: .9rem; font-size: .92rem; }
nav a { margin-right: 1.1rem; color: var(--accent); text-decoration: none; }
nav a:hover { text-decoration: underline; }
.table { overflow-x: auto; margin: 1rem 0 .4rem; }
table { border-collapse: collapse; font-size: .89rem; width: 100%; }
caption { text-align: left; font-weight: 600; padding-bottom: .4rem; }
th { text-align: left; font-weight: 600; color: var(--soft); vertical-align: bottom; }
th, td { padding: .28rem .8rem .28rem 0; }
th:last-child, td:last-child { padding-right: 0; }
thead th { border-bottom: 1px solid var(--ink); }
tbody tr + tr.opens td { border-top: 1px solid var(--line); }
tr.aside td { color: var(--soft); padding-top: 0; }
tr.aside td:nth-child(2) { padding-left: 1rem; }
td.t { white-space: nowrap; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
th.n { white-space: normal; }
.notes { margin: .3rem 0 1.2rem; padding-left: 1.1rem; color: var(--soft); font-size: .85rem; }
figure { margin: 1.2rem 0; }
figure img { width: 100%; height: auto; display: block; }
dl { display: grid; grid-template-columns: minmax(8rem, 14rem) 1fr; gap: .25rem 1rem;
  margin: .8rem 0; font-size: .92rem; }
dt { color: var(--soft); }
dd { margin: 0; overflow-wrap: anywhere; }
.warning { border-left: 4px solid var(--warn); background: var(--warn-wash); color: var(--warn);
  padding: .5rem .9rem; margin: .6rem 0; }
.key { border-left: 4px solid var(--accent); background: var(--wash); padding: .6rem .9rem;
  margin: .8rem 0; }
pre { background: var(--wash); border: 1px solid var(--line); padding: .8rem; overflow-x: auto;
  font-size: .82rem; line-height: 1.45; white-space: pre-wrap; overflow-wrap: anywhere; }
footer { margin-top: 3rem; padding-top: 1rem; border-top: 1px solid var(--line);
  color: var(--soft); font-size: .85rem; overflow-wrap: anywhere; }
@media (max-width: 40rem) {
  dl { grid-template-columns: 1fr; gap: 0; }
  dd { margin-bottom: .5rem; }
}
@media print {
  @page { margin: 16mm; }
  body { padding: 0; max-width: none; font-size: 10.5pt; }
  nav { display: none; }
  figure, .table, .key, .warning { break-inside: avoid; }
  h2, h3, caption { break-after: avoid; }
}"""


@dataclass(frozen=True)
class Section:
    """A section of an HTML page: its heading (plain text), and its blocks (HTML strings)."""

    title: str
    blocks: Sequence[str]


def paragraph(text: str) -> str:
    """Return plain text as an HTML paragraph."""
    return f"<p>{html.escape(text)}</p>"


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
    """Return a table and its notes as HTML."""
    return to_html(grid)


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


def figure(drawn: Figure, alt: str) -> str:
    """Return a figure as an SVG image embedded in HTML; ``alt`` is its alternative text."""
    data = base64.b64encode(to_svg(drawn).encode("utf-8")).decode("ascii")
    return (
        f'<figure><img alt="{html.escape(alt, quote=True)}" '
        f'src="data:image/svg+xml;base64,{data}"></figure>'
    )


def page(title: str, subtitle: str, sections: Iterable[Section], *, footer: str = "") -> str:
    """Return a complete HTML page. All arguments but ``sections`` are plain text."""
    sections = [s for s in sections if s.blocks]
    links = "".join(
        f'<a href="#s{i}">{html.escape(s.title)}</a>' for i, s in enumerate(sections, 1)
    )
    body = "\n".join(
        f'<section id="s{i}"><h2>{html.escape(s.title)}</h2>{"".join(s.blocks)}</section>'
        for i, s in enumerate(sections, 1)
    )
    return PAGE.substitute(
        title=html.escape(title),
        subtitle=html.escape(subtitle),
        css=CSS,
        contents=f"<nav>{links}</nav>" if len(sections) > 1 else "",
        body=body,
        footer=html.escape(footer),
    )


def write_page(text: str, path: str | Path, *, force: bool = False) -> Path:
    """Write the HTML ``text`` to the file ``path``; return the path.

    Raises OutputExists if the file exists, unless ``force`` is true.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    return write_file(path, text.encode("utf-8"), force=force)
