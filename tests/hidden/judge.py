"""Judgement of a diagnosis document against the truth. Pure functions, no thresholds.

A *name* is an effect with its axis; the axis must be right. A name is *asserted* if it is in
``findings`` with an empty ``tied_with`` and is not marked "…-like". A finding that is
confounded with the truth is never wrong. No flight can separate `encoder.scale`, so a finding
that is confounded with `encoder.scale` alone counts as asserted.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tests.hidden.cases import Truth
from tests.hidden.equivalences import UNRATED, equals
from tests.hidden.sizes import EFFECTS, axis_of

Z95 = 1.96
QUIET = ("nothing_found", "off_calibration", "not_identifiable")
RATED_NUMBERS = frozenset({e.parameter for e in EFFECTS.values()} | {"frequency_Hz"})
"""Parameters whose relative error is counted; instants and heights are checked by interval."""
FROM_ZERO = frozenset({"frequency_Hz", "height_m", "time_s"})
"""Second parameters, whose error is relative to themselves, not to an effect's absence."""


@dataclass(frozen=True)
class Number:
    """One parameter of a named cause: its relative error, and whether ± 1.96 std covers it."""

    name: str
    parameter: str
    truth: float
    value: float
    std: float
    error: float
    covered: bool


@dataclass(frozen=True)
class Verdict:
    """The judgement of one case.

    - ``first``: the first finding is a hidden cause.
    - ``first_or_tied``: the first finding is a hidden cause or is confounded with one.
    - ``both``: every hidden cause is among the findings or in their ``tied_with``.
    - ``exact``: ``both``, and there is no other finding.
    - ``wrong``: asserted names that are not hidden.
    - ``reported``: there is a finding, a residual torque or bad data.
    - ``alarm``: ``reported`` although nothing is hidden.
    - ``axis``: the first residual torque names an axis on which a hidden effect acts.
    """

    first: bool
    first_or_tied: bool
    both: bool
    exact: bool
    tied: bool
    asserted: int
    wrong: tuple[str, ...]
    reported: bool
    alarm: bool
    axis: bool
    rated: bool
    numbers: tuple[Number, ...]


def names(document: Mapping[str, Any]) -> list[str]:
    """The findings' names, strongest first."""
    return [_name(f) for f in document["findings"]]


def _name(finding: Mapping[str, Any]) -> str:
    effect = str(finding["effect"]).removesuffix("-like")
    return effect if finding.get("axis") is None else f"{effect}.{finding['axis']}"


def _asserted(finding: Mapping[str, Any]) -> bool:
    like = str(finding["effect"]).endswith("-like") or bool(finding.get("like"))
    return all(n.startswith("encoder.scale.") for n in finding["tied_with"]) and not like


def judge(document: Mapping[str, Any], truth: Truth) -> Verdict:
    """The verdict on a diagnosis document, given the hidden effects."""
    findings = document["findings"]
    hidden = set(truth.names)
    right = {n for t in (*truth.names, *truth.unseen) for n in equals(t)}
    named = [_name(f) for f in findings]
    alternatives = [{n, *f["tied_with"]} for n, f in zip(named, findings, strict=True)]
    asserted = [n for n, f in zip(named, findings, strict=True) if _asserted(f)]
    residual = document["leftover"]
    matched = _matching(truth.names, alternatives)
    axes = {axis_of(n) for n in hidden}
    anything = bool(named or residual) or document["verdict"] not in QUIET
    return Verdict(
        first=bool(named) and named[0] in right and bool(hidden),
        first_or_tied=bool(alternatives) and bool(alternatives[0] & right) and bool(hidden),
        both=bool(hidden) and len(matched) == len(hidden),
        exact=len(matched) == len(hidden) == len(findings),
        tied=any(f["tied_with"] for f in findings),
        asserted=len(asserted),
        wrong=tuple(n for n in asserted if n not in right),
        reported=anything,
        alarm=anything and not hidden,
        axis=bool(residual) and residual[0]["axis"] in axes,
        rated=not UNRATED & hidden,
        numbers=tuple(_numbers(findings, truth)),
    )


def _matching(wanted: Sequence[str], alternatives: Sequence[set[str]]) -> dict[str, int]:
    """Hidden cause → index of its finding, each finding at most once.

    Each order of the hidden causes is tried, because a finding may match several of them.
    """
    best: dict[str, int] = {}
    for order in itertools.permutations(wanted):
        taken: dict[str, int] = {}
        for name in order:
            for i, m in enumerate(alternatives):
                if i not in taken.values() and m & equals(name):
                    taken[name] = i
                    break
        if len(taken) > len(best):
            best = taken
    return best


def _numbers(findings: Sequence[Mapping[str, Any]], truth: Truth) -> list[Number]:
    out = []
    for f in findings:
        name = _name(f)
        if name not in truth.names:
            continue
        for parameter, true in truth.values[name].items():
            if parameter not in f["parameters"]:
                continue
            estimate = f["parameters"][parameter]
            value, std = (
                float("nan" if estimate[k] is None else estimate[k]) for k in ("value", "std")
            )
            if name.startswith("disturbance.periodic") and parameter == "torque_Nm":
                value = abs(value)  # −τ sin equals τ sin half a period later
            null = 0.0 if parameter in FROM_ZERO else EFFECTS[name].null
            null = 0.0 if name == "motor.saturation" else null
            error = abs(value - true) / abs(true - null)
            covered = abs(value - true) <= Z95 * std
            out.append(Number(name, parameter, true, value, std, error, covered))
    return out
