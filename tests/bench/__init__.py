"""Every figure that the docs quote, measured: ``make bench`` writes docs/results/benchmarks.md.

A bench is one file here, ``bench_<topic>.py``, with ``TITLE``, optionally ``INTRO`` and
``COMMAND``, and ``measure()``, a list of `Figure` and `Table`. They are kept in
benchmarks.json, so that one topic can be measured again without the others, and the page is
rendered from that file alone.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """One measured number, and the bar it is held to (empty where there is none)."""

    what: str
    value: str
    bar: str = ""
    met: bool | None = None
    how: str = ""


@dataclass(frozen=True)
class Table:
    """Measured things side by side, where one number a row would not do."""

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def at_most(what: str, value: float, bar: float, unit: str, *, how: str = "") -> Figure:
    """A figure that must not exceed its bar."""
    return Figure(what, f"{value:.3g} {unit}".strip(), f"≤ {bar:g} {unit}", value <= bar, how)


def at_least(what: str, value: float, bar: float, unit: str, *, how: str = "") -> Figure:
    """A figure that must reach its bar."""
    return Figure(what, f"{value:.4g} {unit}".strip(), f"≥ {bar:g} {unit}", value >= bar, how)
