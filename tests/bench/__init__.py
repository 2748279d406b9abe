"""Benchmarks: ``make bench`` measures the figures of docs/results/benchmarks.md.

A benchmark is one file, ``bench_<topic>.py``, with ``TITLE``, optionally ``INTRO`` and ``COMMAND``,
and ``measure()``, which returns a list of `Figure` and `Table`. benchmarks.json stores them by
topic, so that one topic can be measured again without the others. The page is rendered from that
file alone.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """A measured number with its required value ``bar``, as text (empty: none)."""

    what: str
    value: str
    bar: str = ""
    met: bool | None = None
    how: str = ""


@dataclass(frozen=True)
class Table:
    """A table of measurements with several numbers in a row."""

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def at_most(what: str, value: float, bar: float, unit: str, *, how: str = "") -> Figure:
    """Returns a figure whose value must not exceed ``bar``."""
    return Figure(what, f"{value:.3g} {unit}".strip(), f"≤ {bar:g} {unit}", value <= bar, how)


def at_least(what: str, value: float, bar: float, unit: str, *, how: str = "") -> Figure:
    """Returns a figure whose value must be at least ``bar``."""
    return Figure(what, f"{value:.4g} {unit}".strip(), f"≥ {bar:g} {unit}", value >= bar, how)
