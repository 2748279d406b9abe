"""Rates over judged cases: the project's criteria, and the confusion matrix."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.bench import Figure
from tests.hidden.cases import CLASSES, Truth
from tests.hidden.equivalences import equals
from tests.hidden.judge import RATED_NUMBERS, Number, Verdict, judge, names
from tests.hidden.rig_cases import RIG_CLASSES
from tests.hidden.third_cases import THIRD_CLASSES

PLANS = ("rich", "steps", "run-step")
LEAST_STATEMENTS = 20
"""Of a bin of confidence: with 20, one wrong statement is worth 0.05"""


@dataclass(frozen=True)
class Judged:
    """A line of `tests.hidden.run` with its verdict (None: not flown, or the diagnosis failed)."""

    line: dict[str, Any]
    verdict: Verdict | None

    @property
    def group(self) -> str:
        return str(self.line["group"])

    @property
    def shown(self) -> bool:
        """An identifiable effect is hidden."""
        return bool(self.line["truth"]["names"])


@dataclass(frozen=True)
class Rate:
    """``hits`` of ``of``; ``bar`` is the required minimum share, or maximum if ``at_most``."""

    what: str
    hits: int
    of: int
    bar: float | None = None
    at_most: bool = False

    @property
    def share(self) -> float:
        return self.hits / self.of if self.of else float("nan")

    @property
    def met(self) -> bool | None:
        if self.bar is None or not self.of:
            return None
        return self.share <= self.bar if self.at_most else self.share >= self.bar

    @property
    def text(self) -> str:
        return f"{100 * self.share:.1f} % ({self.hits}/{self.of})" if self.of else "–"

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the share; (0, 1) without cases."""
        if not self.of:
            return 0.0, 1.0
        from scipy.stats import binomtest

        result = binomtest(self.hits, self.of).proportion_ci(0.95, method="wilson")
        return float(result.low), float(result.high)

    @property
    def between(self) -> str:
        low, high = self.interval
        return f"{100 * low:.1f} to {100 * high:.1f} %"

    @property
    def asked(self) -> str:
        return "" if self.bar is None else f"{'≤' if self.at_most else '≥'} {100 * self.bar:g} %"

    @property
    def figure(self) -> Figure:
        """The rate as a row of a benchmark."""
        return Figure(self.what, self.text, self.asked, self.met, f"95 % interval {self.between}")


def judged(lines: Iterable[dict[str, Any]]) -> list[Judged]:
    """Every line with its verdict."""
    return [
        Judged(a, judge(a["document"], Truth(**a["truth"])) if "document" in a else None)
        for a in lines
    ]


def count(
    cases: Iterable[Judged], what: str, hit: Callable[[Verdict], bool], bar: float | None = None,
    *, at_most: bool = False,
) -> Rate:  # fmt: skip
    """Rate of the cases with a hit; a diagnosis that failed is a miss."""
    cases = list(cases)
    hits = sum(j.verdict is not None and hit(j.verdict) for j in cases)
    if at_most:  # a failed diagnosis is also an alarm
        hits += sum(j.verdict is None for j in cases)
    return Rate(what, hits, len(cases), bar, at_most)


def rates(all_cases: Sequence[Judged]) -> list[Rate]:
    """The rows of the project's criteria, then the others."""
    cases = [j for j in all_cases if "not_flown" not in j.line]
    faults = len([j for j in cases if j.verdict is None])

    def of(*groups: str) -> list[Judged]:
        """Cases of these classes with an effect to be named."""
        return [
            j for j in cases
            if j.group in groups and j.shown and (j.verdict is None or j.verdict.rated)
        ]  # fmt: skip

    def in_class(*groups: str) -> list[Judged]:
        return [j for j in cases if j.group in groups]

    numbers = _numbers(cases)
    rated = [n for n in numbers if n.parameter in RATED_NUMBERS]
    verdicts = [j.verdict for j in cases if j.verdict is not None]
    wrong, asserted = sum(len(v.wrong) for v in verdicts), sum(v.asserted for v in verdicts)
    first = "right cause first"
    single = ("steps-single", "run-step-single")
    first_or_tied = "right cause first, or tied with the first"
    rows = [
        count(of("rich-medium", "rich-large"), f"{first}, rich plan, medium and large",
              lambda v: v.first, 0.97),
        *(count(in_class(f"{p}-nothing"), f"false alarms where nothing is hidden, {p}",
                lambda v: v.alarm, 0.01, at_most=True) for p in PLANS),
        count(in_class(*(f"{p}-coloured-nothing" for p in PLANS)),
              "false alarms where nothing is hidden, noise colour drawn, all plans",
              lambda v: v.alarm, 0.01, at_most=True),
        count(in_class("run-step-coloured"),
              "flights with a wrong name asserted, run-step, noise colour drawn",
              lambda v: bool(v.wrong), 0.01, at_most=True),
        count(of("rich-three"), "all of three hidden causes", lambda v: v.both, 0.85),
        count(of("rich-pair"), "both of two hidden causes", lambda v: v.both, 0.97),
        count(of("rich-pair"), "exactly those two", lambda v: v.exact, 0.92),
        Rate("95 % intervals that hold the truth", sum(n.covered for n in numbers), len(numbers),
             0.90),
        count(in_class("rich-outside", "steps-outside"),
              "outside the catalogue: flagged with the right axis", lambda v: v.axis, 0.95),
        Rate("names asserted without a tie that are wrong, over everything", wrong, asserted, 0.01,
             at_most=True),
        count(of("rich-small"), f"{first}, rich plan, small", lambda v: v.first),
        count(of("rich-medium", "rich-large"), f"{first_or_tied}, rich plan, medium and large",
              lambda v: v.first_or_tied, 0.99),
        count(of("rich-small"), f"{first_or_tied}, rich plan, small", lambda v: v.first_or_tied),
        *(count(of(g), f"{first}, {g.removesuffix('-single')}, medium and large",
                lambda v: v.first) for g in single),
        *(count(of(g), f"{first_or_tied}, {g.removesuffix('-single')}, medium and large",
                lambda v: v.first_or_tied, bar)
          for g, bar in zip(single, (0.95, 0.7), strict=True)),
        count(of("rich-medium", "rich-large"), "and nothing else, rich plan, medium and large",
              lambda v: v.exact),
        count(of("rich-medium", "rich-large"), "something said, rich plan, medium and large",
              lambda v: v.reported),
        Rate("parameter errors within 5 %", sum(n.error <= 0.05 for n in rated), len(rated)),
        Rate("diagnoses that failed", faults, len(cases), 0.0, at_most=True),
        Rate("flights that did not reach their end (left out)", len(all_cases) - len(cases),
             len(all_cases)),
    ]  # fmt: skip
    return [r for r in rows if r.of]


def _numbers(cases: Iterable[Judged]) -> list[Number]:
    return [n for j in cases if j.verdict is not None for n in j.verdict.numbers]


def median_error(cases: Iterable[Judged]) -> float:
    """Median relative error of the named causes' parameters; NaN without a named cause."""
    errors = [n.error for n in _numbers(cases) if n.parameter in RATED_NUMBERS]
    return float(np.median(errors)) if errors else float("nan")


def statements(j: Judged) -> list[tuple[float, bool]]:
    """(confidence, whether it is right) of each finding that states a confidence.

    It is right if the finding, or an effect confounded with it, is hidden.
    """
    if j.verdict is None:
        return []
    truth, document = j.line["truth"], j.line["document"]
    right = {n for t in (*truth["names"], *truth["unseen"]) for n in equals(t)}
    return [
        (float(f["confidence"]), bool({name, *f["tied_with"]} & right))
        for name, f in zip(names(document), document["findings"], strict=True)
        if f.get("confidence") is not None
    ]


def largest_deviation(cases: Iterable[Judged]) -> tuple[float, int]:
    """Largest difference between mean confidence and share of right statements, and their number.

    Of ten bins of confidence, those with `LEAST_STATEMENTS` count; NaN without any.
    """
    stated = np.array([s for j in cases for s in statements(j)], dtype=float).reshape(-1, 2)
    place = np.minimum((10 * stated[:, 0]).astype(int), 9)
    bins = [stated[place == b] for b in range(10)]
    away = [abs(float(np.subtract(*b.mean(axis=0)))) for b in bins if len(b) >= LEAST_STATEMENTS]
    return max(away, default=float("nan")), len(stated)


def confusions(cases: Iterable[Judged]) -> list[tuple[str, str, int, int, str]]:
    """Rows (hidden effect, class, cases, right first, names found first)."""
    rows: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    right: Counter[tuple[str, str]] = Counter()
    for j in cases:
        if "truth" not in j.line:
            continue
        truth = j.line["truth"]
        hidden = " + ".join([*truth["names"], *(f"({n})" for n in truth["unseen"])]) or "nothing"
        place = (hidden, j.group)
        rows[place][_first(j)] += 1
        right[place] += j.verdict is not None and (
            j.verdict.first or not (j.shown or j.verdict.alarm)
        )
    return [
        (hidden, group, sum(result.values()), right[hidden, group], _listed(result))
        for (hidden, group), result in sorted(
            rows.items(), key=lambda r: (_order(r[0][1]), r[0][0])
        )
    ]


def _first(j: Judged) -> str:
    if j.verdict is None:
        return "failed"
    document = j.line["document"]
    named = names(document)
    if not named:
        axes = [str(a["axis"] or "no axis") for a in document["leftover"]]
        return f"unknown on {'/'.join(axes)}" if axes else str(document["verdict"])
    tie = " (tied)" if document["findings"][0]["tied_with"] else ""
    return " + ".join(named) + tie


def _listed(result: Counter[str]) -> str:
    return ", ".join(f"{name} {n}" if n > 1 else name for name, n in result.most_common())


def _order(group: str) -> int:
    return [*CLASSES, *RIG_CLASSES, *THIRD_CLASSES].index(group)


def times_s(cases: Iterable[Judged]) -> tuple[float, float]:
    """Median and 95th percentile of the wall time of a diagnosis."""
    t = [j.line["wall_s"] for j in cases if "wall_s" in j.line]
    return (float(np.median(t)), float(np.percentile(t, 95))) if t else (float("nan"),) * 2


def summary(lines: Sequence[dict[str, Any]]) -> str:
    """The confusion matrix by rows, without its empty cells, then the rates."""
    cases = judged(lines)
    out = [f"{'hidden':45} {'class':16} {'right':>7}  found"]
    out += [f"{h:45} {g:16} {r:>3}/{n:<3}  {f}" for h, g, n, r, f in confusions(cases)]
    out.append("")
    for r in rates(cases):
        met = {True: "met", False: "NOT MET", None: ""}[r.met]
        out.append(f"{r.what:66} {r.text:>20}  {r.between:16}  {r.asked:8} {met}")
    out.append(f"{'parameter error of the named cause, median':66} "
               f"{100 * median_error(cases):>18.1f} %  ≤ 5 %")  # fmt: skip
    middle, slow = times_s(cases)
    out.append(
        f"{'seconds for one diagnosis, median and 95th percentile':66} {middle:.1f}, {slow:.1f}"
    )
    return "\n".join(out)
