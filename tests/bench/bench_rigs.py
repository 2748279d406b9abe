"""Diagnosis of hidden effects on rigs that it was not made on. ``make bench-rigs``.

Environment variables as in `tests.bench.bench_hidden`: HIDDEN_FIRST, HIDDEN_SHARE, HIDDEN_JOBS.
Finished cases are not repeated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from tests.bench import Figure, Table
from tests.bench.bench_hidden import AT_ONCE, FIRST, JOBS, SHARE, reliability_figures
from tests.hidden import outside
from tests.hidden.rig_cases import RIG_CLASSES, draw_on_other_rig
from tests.hidden.run import run, wanted
from tests.hidden.tally import Judged, Rate, confusions, judged, summary, times_s

TITLE = "Hidden effects on other rigs"
COMMAND = "make bench-rigs"
INTRO = f"""Every flight is one of another rig: arms, inertias, hover voltage, encoders, sample
rate, noise colour, controller and log are drawn as listed in
[other_rigs.py](../tests/hidden/other_rigs.py). The profile is wrong by up to ± 7 %, and a third of
the profiles have no controller. The effects are those of the paper's rig, scaled to the drawn one
([rig_cases.py](../tests/hidden/rig_cases.py)); seeds {FIRST} and up. Brackets: 95 % interval of a
share (Wilson)."""
SILENT = ("rigs-nothing", "rigs-step-nothing")


def measure() -> list[Figure | Table]:
    lines = list(run(wanted(FIRST, SHARE, RIG_CLASSES), "whole", processes=JOBS).values())
    print(summary(lines))
    cases = [j for j in judged(lines) if "not_flown" not in j.line]
    rates = [*of_all(cases), *without_controller(cases)]
    middle, slow = times_s(cases)
    return [
        *(r.figure for r in rates),
        *outside.figures(of(cases, "rigs-outside"), processes=JOBS),
        *reliability_figures(cases),
        Figure("flights that left the bounds (not diagnosed)", str(len(lines) - len(cases))),
        Figure(f"s for one diagnosis, {AT_ONCE} at once: median, 95 % quantile",
               f"{middle:.1f}, {slow:.1f}"),
        Table("Hidden and reported effect (with counts where several)",
              ("hidden", "flights", "right", "found"),
              tuple((h, g, f"{right}/{n}", found) for h, g, n, right, found in confusions(cases))),
    ]  # fmt: skip


def of_all(cases: list[Judged]) -> list[Rate]:
    return [
        share(named(cases), "right cause first, or confounded with the first", right, 0.97),
        share(of(cases, *SILENT), "nothing hidden: nothing asserted", silent, 0.99),
        share(cases, "flights with a wrong name asserted", wrong, 0.01, at_most=True),
        share(of(cases, "rigs-pair"), "both of two hidden causes",
              lambda j: j.verdict is not None and j.verdict.both),
        share(of(cases, "rigs-outside"), "outside the catalogue: right axis",
              lambda j: j.verdict is not None and j.verdict.axis, 0.95),
        share(cases, "diagnoses that failed", lambda j: j.verdict is None, 0.0, at_most=True),
    ]  # fmt: skip


def without_controller(cases: list[Judged]) -> list[Rate]:
    """The same where the profile has no controller."""
    some = [j for j in cases if not draw_on_other_rig(j.group, int(j.line["seed"])).rig.known]
    what = "controller unknown: "
    return [
        share(named(some), f"{what}right cause first, or confounded with the first", right, 0.93),
        share(of(some, *SILENT), f"{what}nothing hidden: nothing asserted", silent, 0.99),
        share(some, f"{what}flights with a wrong name asserted", wrong, 0.01, at_most=True),
    ]


def share(
    cases: list[Judged], what: str, hit: Callable[[Judged], bool], bar: float | None = None,
    *, at_most: bool = False,
) -> Rate:  # fmt: skip
    return Rate(what, sum(map(hit, cases)), len(cases), bar, at_most)


def of(cases: Iterable[Judged], *groups: str) -> list[Judged]:
    return [j for j in cases if j.group in groups]


def named(cases: Iterable[Judged]) -> list[Judged]:
    """Cases of one effect that can be judged by its name."""
    return [
        j for j in of(cases, "rigs-single")
        if j.shown and (j.verdict is None or j.verdict.rated)
    ]  # fmt: skip


def right(j: Judged) -> bool:
    return j.verdict is not None and j.verdict.first_or_tied


def wrong(j: Judged) -> bool:
    return j.verdict is not None and bool(j.verdict.wrong)


def silent(j: Judged) -> bool:
    """No wrong name without an alternative, and no residual torque."""
    return j.verdict is not None and not j.verdict.wrong and not j.line["document"]["leftover"]
