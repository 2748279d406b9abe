"""What each rule of the diagnosis is worth, by flights with and without it. ``make bench-rules``.

Environment variables as in `tests.bench.bench_hidden`: HIDDEN_FIRST, HIDDEN_SHARE, HIDDEN_JOBS.
Finished cases are not repeated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tests.bench import Figure, Table
from tests.bench.bench_hidden import FIRST, JOBS, SHARE
from tests.bench.bench_rigs import SILENT, right, silent, wrong
from tests.hidden.rig_cases import RIG_CLASSES
from tests.hidden.rules import RULES
from tests.hidden.run import Line, run, wanted
from tests.hidden.tally import Judged, judged
from tests.hidden.third_cases import THIRD_CLASSES

COLOURED = ("rich-coloured-nothing", "run-step-coloured-nothing")
GROUPS = (
    *RIG_CLASSES, *THIRD_CLASSES, "steps-single", "run-step-single", "run-step-nothing",
    "rich-medium", "rich-pair", *COLOURED, "run-step-coloured", "steps-outside",
)  # fmt: skip
NOTHING_HIDDEN = (*SILENT, "run-step-nothing", "third-nothing", *COLOURED)
MOST = 10
"""Flights per rule that are diagnosed without it"""

TITLE = "What each rule of the diagnosis is worth"
COMMAND = "make bench-rules"
INTRO = f"""Flights of the other rigs and of the paper's rig, seeds {FIRST} and up. A first
diagnosis notes the rules that changed anything on the way to its answer; up to {MOST} of these
flights, evenly chosen, are diagnosed again without the rule
([rules.py](../tests/hidden/rules.py)). An answer is better than another if it is right and the
other is not, or if it is silent and the other asserts a wrong name."""


def measure() -> list[Figure | Table]:
    lines = run(wanted(FIRST, SHARE, GROUPS), "rules", processes=JOBS)
    rows, needed = [], 0
    for rule in RULES:
        flights = [a for a in lines.values() if rule.name in a.get("document", {}).get("rules", ())]
        jobs = [(str(a["group"]), int(a["seed"])) for a in evenly(flights, MOST)]
        less = run(jobs, f"without {rule.name}", processes=JOBS) if jobs else {}
        better, worse = compared(lines, less)
        needed += better > worse
        rows.append((rule.name, *map(str, (len(flights), len(jobs), better, worse))))
    return [
        Figure(
            "rules with which an answer is better", f"{needed} of {len(rows)}",
            how=f"{len(lines)} flights",
        ),
        Table(
            "Rules of the diagnosis",
            ("rule", "flights in which it changed anything", "diagnosed without it",
             "answers better with it", "better without it"),
            tuple(rows),
        ),
    ]  # fmt: skip


def evenly(lines: Sequence[Line], most: int) -> list[Line]:
    """At most that many of the lines, evenly spread.

    >>> [a["seed"] for a in evenly([{"seed": n} for n in range(6)], 3)]
    [0, 2, 4]
    """
    n = min(most, len(lines))
    return [lines[k * len(lines) // n] for k in range(n)]


def compared(whole: Mapping[str, Line], less: Mapping[str, Line]) -> tuple[int, int]:
    """Count the flights of ``less`` whose answer is better in ``whole``, and those with a worse."""
    pairs = [
        (quality(a), quality(b))
        for a, b in zip(judged(whole[name] for name in less), judged(less.values()), strict=True)
    ]
    return sum(a > b for a, b in pairs), sum(a < b for a, b in pairs)


def quality(j: Judged) -> int:
    """0: a wrong name is asserted, or the diagnosis failed; 2: the answer is right; 1: neither."""
    if j.verdict is None or wrong(j):
        return 0
    if j.group in NOTHING_HIDDEN:
        return 2 if silent(j) else 0
    if j.group.endswith("-pair"):
        return 2 if j.verdict.both else 1
    if j.group.endswith("-outside"):
        return 2 if j.verdict.axis else 1
    return 2 if right(j) else 1
