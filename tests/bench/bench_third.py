"""Diagnosis of hidden effects on a plant that shares no equation with the package.

Environment variables as in `tests.bench.bench_hidden`: HIDDEN_FIRST, HIDDEN_SHARE, HIDDEN_JOBS.
Finished cases are not repeated.
"""

from __future__ import annotations

from tests.bench import Figure, Table
from tests.bench.bench_hidden import FIRST, HEAD, JOBS, SHARE, reliability_figures, rows
from tests.bench.bench_rigs import of, right, share, silent, wrong
from tests.hidden.outside import proposes_true_formula
from tests.hidden.run import run, wanted
from tests.hidden.tally import Judged, Rate, judged, summary
from tests.hidden.third_cases import THIRD_CLASSES, draw_third

TITLE = "Hidden effects on a third plant"
INTRO = f"""Flights of a laboratory that is written apart from the package and from the emulated
rig ([third_plant](../tests/hidden/third_plant)): kinetics of point masses, formulas of the effects,
controller, noise and references are its own. Each case has a log and a hold-out flight; a quarter
of the profiles have no controller. Effects are sized by their signal ratio; those below 2 need not
be found. Seeds {FIRST} and up. Brackets: 95 % interval of a share (Wilson)."""
SINGLE = (("rich", 0.97), ("steps", 0.95), ("run-step", 0.7))
"""Plans and the required share of right answers, as in `tests.hidden.tally.rates`"""


def measure() -> list[Figure | Table]:
    lines = list(run(wanted(FIRST, SHARE, THIRD_CLASSES), "whole", processes=JOBS).values())
    print(summary(lines))
    cases = [j for j in judged(lines) if "not_flown" not in j.line]
    known = [j for j in cases if draw_third(j.group, int(j.line["seed"])).known]
    unknown = [j for j in cases if j not in known]
    rates = [*of_all(cases), *of_all(known, "controller known: "),
             *of_all(unknown, "controller unknown: ")]  # fmt: skip
    return [
        *(r.figure for r in rates),
        *reliability_figures(cases),
        Figure("flights outside the bounds (not diagnosed)", str(len(lines) - len(cases))),
        Table("Hidden and reported effect (with counts where several)", HEAD, tuple(rows(cases))),
    ]


def of_all(cases: list[Judged], what: str = "") -> list[Rate]:
    """The rates of these cases; ``what``: how they differ from all cases, which have the bars."""
    rates = [
        *(share(seen(cases, f"third-{plan}"),
                f"{plan}: right cause first, or confounded with the first", right, bar)
          for plan, bar in SINGLE),
        share(of(cases, "third-nothing"), "nothing hidden: nothing asserted", silent, 0.99),
        share(cases, "flights with a wrong name asserted", wrong, 0.01, at_most=True),
        share(seen(cases, "third-pair"), "both of two hidden causes",
              lambda j: j.verdict is not None and j.verdict.both, 0.97),
        share(seen(cases, "third-outside"), "outside the catalogue: right axis",
              lambda j: j.verdict is not None and j.verdict.axis, 0.95),
        share(seen(cases, "third-outside"), "outside the catalogue: true formula proposed",
              proposes_true_formula),
        share(cases, "diagnoses that failed", lambda j: j.verdict is None, 0.0, at_most=True),
    ]  # fmt: skip
    return [Rate(what + r.what, r.hits, r.of, None if what else r.bar, r.at_most) for r in rates]


def seen(cases: list[Judged], group: str) -> list[Judged]:
    """The cases of a class whose effects a recording can show by their names."""
    return [
        j for j in of(cases, group)
        if j.shown and not j.line["truth"]["unseen"] and (j.verdict is None or j.verdict.rated)
    ]  # fmt: skip
