"""What is right: a document of the contract against a truth. Pure functions, no thresholds.

A *name* is an effect with its axis; the axis must be right. A name is *asserted* when it stands
in ``findings`` with nothing in ``tied_with`` and does not call itself "…-like". A tie that holds
the truth is never wrong. A tie with `encoder.scale` alone, which no flight can part, is no way
out: what is tied with nothing else counts as asserted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tests.hidden.cases import Truth
from tests.hidden.equivalences import UNRATED, equals
from tests.hidden.sizes import EFFECTS, axis_of

Z95 = 1.96
QUIET = ("nothing_found", "not_identifiable")
RATED_NUMBERS = frozenset({e.parameter for e in EFFECTS.values()} | {"frequency_Hz"})
"""Parameters whose relative error is counted; instants and heights are held to intervals only."""
FROM_ZERO = frozenset({"frequency_Hz", "height_m", "time_s"})
"""Second parameters, whose error is relative to themselves, not to an effect's absence."""


@dataclass(frozen=True)
class Number:
    """One parameter of a cause that was named: its relative error, and whether ± 1.96 std holds."""

    name: str
    parameter: str
    truth: float
    value: float
    std: float
    error: float
    covered: bool


@dataclass(frozen=True)
class Verdict:
    """One case, judged.

    ``first``: the first finding is a hidden cause. ``told``: it is, or its tie holds one.
    ``both``: every hidden cause is among the findings (or their ties). ``exact``: and nothing
    else is. ``wrong``: names asserted that are not hidden. ``said``: a finding, an unknown rest,
    bad data; ``alarm``: that, where there is nothing to say. ``axis``: the first leftover
    names an axis that something hidden acts on.
    """

    first: bool
    told: bool
    both: bool
    exact: bool
    tied: bool
    asserted: int
    wrong: tuple[str, ...]
    said: bool
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
    """A diagnosis' document against what was hidden."""
    findings = document["findings"]
    hidden = set(truth.names)
    right = {n for t in (*truth.names, *truth.unseen) for n in equals(t)}
    said = [_name(f) for f in findings]
    meant = [{n, *f["tied_with"]} for n, f in zip(said, findings, strict=True)]
    asserted = [n for n, f in zip(said, findings, strict=True) if _asserted(f)]
    leftover = document["leftover"]
    matched = _matching(truth.names, meant)
    axes = {axis_of(n) for n in hidden}
    anything = bool(said or leftover) or document["verdict"] not in QUIET
    return Verdict(
        first=bool(said) and said[0] in right and bool(hidden),
        told=bool(meant) and bool(meant[0] & right) and bool(hidden),
        both=bool(hidden) and len(matched) == len(hidden),
        exact=len(matched) == len(hidden) == len(findings),
        tied=any(f["tied_with"] for f in findings),
        asserted=len(asserted),
        wrong=tuple(n for n in asserted if n not in right),
        said=anything,
        alarm=anything and not hidden,
        axis=bool(leftover) and leftover[0]["axis"] in axes,
        rated=not UNRATED & hidden,
        numbers=tuple(_numbers(findings, truth)),
    )


def _matching(wanted: Sequence[str], meant: Sequence[set[str]]) -> dict[str, int]:
    """Hidden cause → the finding that means it, each finding at most once (a greedy matching
    would do for one cause; for two, try both orders)."""
    best: dict[str, int] = {}
    for order in (list(wanted), list(reversed(wanted))):
        taken: dict[str, int] = {}
        for name in order:
            for i, m in enumerate(meant):
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
            found = f["parameters"][parameter]
            value, std = (float("nan" if found[k] is None else found[k]) for k in ("value", "std"))
            if name.startswith("disturbance.periodic") and parameter == "torque_Nm":
                value = abs(value)  # −τ sin is τ sin half a period later
            null = 0.0 if parameter in FROM_ZERO else EFFECTS[name].null
            null = 0.0 if name == "motor.saturation" else null
            error = abs(value - true) / abs(true - null)
            covered = abs(value - true) <= Z95 * std
            out.append(Number(name, parameter, true, value, std, error, covered))
    return out
