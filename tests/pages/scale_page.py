"""What 10⁶ recordings cost, from the measured costs of one, in scale.md.

With N recordings, c s of CPU time each, o s of that of `batch` itself, and C cores::

    CPU time N·c      duration N·c/C      cores that one `batch` keeps busy c/o
    data sent at that speed: (MB in + MB out)/o
"""

from __future__ import annotations

from collections.abc import Mapping
from math import floor, log10

from tests.bench import page as results
from tests.pages.page import Page, table

RECORDINGS, CORES = 10**6, 64
"""The laboratory of the plan: a computer of this size costs as much as a rig. Chosen."""
NETWORK_MB_PER_S = 100.0
"""1 Gbit/s, in MB/s with 20 % for the protocol (a convention)"""
DAY, HOUR = 86400.0, 3600.0


def unit_costs() -> dict[str, dict[str, float]]:
    """Returns verb → column → value of the measured table."""
    kept = results.load()["unit_costs"]["tables"][0]
    return {
        row[0]: {name: float(x) for name, x in zip(kept["head"][1:], row[1:], strict=True)}
        for row in kept["rows"]
    }


def one() -> str:
    """Markdown: the costs of one recording as measured."""
    head = ("verb", "CPU s", "MB in", "MB out", "CPU s of `batch` itself", "kB on disk")
    rows = [
        (f"`{verb}`", f"{c['CPU s']:.3g}", f"{c['MB in']:.3g}", f"{c['MB out']:.2g}",
         f"{c['CPU s of `batch` itself']:.2g}", f"{_disk_kb(c):.3g}")
        for verb, c in unit_costs().items()
    ]  # fmt: skip
    return table(head, rows)


def million() -> str:
    """Markdown: the costs of `RECORDINGS`."""
    head = ("verb", "CPU time", f"{CORES} cores need", "on disk")
    rows = []
    for verb, c in unit_costs().items():
        total = RECORDINGS * c["CPU s"]
        rows.append((
            f"`{verb}`", f"{_two(total / HOUR)} h", _duration(total / CORES),
            f"{_two(RECORDINGS * _disk_kb(c) / 1e6)} GB",
        ))  # fmt: skip
    return table(head, rows)


def bottleneck() -> str:
    """Markdown: how many cores one `batch` keeps busy, and what it needs for that."""
    head = ("verb", "cores that one `batch` keeps busy", "it sends", "1 Gbit/s feeds",
            "memory for 10⁶ rows")  # fmt: skip
    rows = []
    for verb, c in unit_costs().items():
        own, sent = c["CPU s of `batch` itself"], c["MB in"] + c["MB out"]
        rows.append((
            f"`{verb}`", _two(c["CPU s"] / own), f"{_two(sent / own)} MB/s",
            f"{_two(NETWORK_MB_PER_S / sent * c['CPU s'])} cores",
            f"{_two(RECORDINGS * c['kB of memory'] / 1e6)} GB",
        ))  # fmt: skip
    return table(head, rows)


def _disk_kb(c: Mapping[str, float]) -> float:
    return c["kB of documents and models"] + c["kB of journal"] + c["kB of results.csv"]


def _two(x: float) -> str:
    """Returns a number with two significant digits, with spaces between thousands.

    >>> _two(12345.0), _two(0.1234)
    ('12 000', '0.12')
    """
    digits = max(0, 1 - floor(log10(x)))
    return f"{round(x, 1 - floor(log10(x))):,.{digits}f}".replace(",", " ")


def _duration(s: float) -> str:
    return f"{_two(s / DAY)} days" if s > DAY else f"{_two(s / HOUR)} h"


PAGE = Page("docs/explanation/scale.md", {"one": one, "million": million, "bottleneck": bottleneck})
