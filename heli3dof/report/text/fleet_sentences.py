"""Write the sentences on a fleet: changes, rigs that differ, unused recordings."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from heli3dof.fleet.change_search import LEAST_FLIGHTS, REPORTED, Change
from heli3dof.fleet.result import Fleet
from heli3dof.fleet.siblings import Difference
from heli3dof.fleet.tracks import BadRecording, Track
from heli3dof.recording.atomic_write import stem
from heli3dof.report.text.number_format import significant

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
WORDS = {"step": "a step", "drift": "a drift", "deviating": "one deviating flight"}
MOST_REASONS = 3
"""Largest number of reasons for unused recordings that a sentence names (a convention)"""


def finding_sentences(fleet: Fleet) -> tuple[str, ...]:
    """Return a sentence on each change (or that none was found), then on each differing rig."""
    different = [difference_sentence(quantity, d) for quantity, d in fleet.differences()]
    return (*change_sentences(fleet), *different)


def change_sentences(fleet: Fleet) -> list[str]:
    """Return a sentence on each change, or that none was found, or that flights are too few."""
    found = [
        change_sentence(group.track, group.change)
        + (f" {', '.join(group.moved)} changed by the inverse factor." if group.moved else "")
        for group in fleet.change_groups()
    ]
    if not found and any(len(r.track.y) >= LEAST_FLIGHTS for r in fleet.tracks()):
        found = [f"No quantity of {_count(len(fleet.rigs), 'rig')} changed."]
    elif not found:
        found = [f"No rig has the {LEAST_FLIGHTS} flights that a search for changes needs."]
    return found


def change_sentence(track: Track, change: Change) -> str:
    """Return one change as a sentence: which rig and quantity, when, by how much, how probable."""
    size = signed_size(change.size, change.interval)
    what = f"{track.rig}: {track.quantity}"
    others = [
        f"{WORDS[k]} {percent(p)}" for k, p in change.kinds.items() if k != change.kind and p > 0.05
    ]
    sure = f"probability {percent(change.probability)}"
    if others:
        sure += f", of which {WORDS[change.kind]} {percent(change.kinds[change.kind])}, "
        sure += ", ".join(others)
    if change.kind == "drift":
        ends = f"from {flight_name(track, change.first)} to {flight_name(track, change.last)}"
        return f"{what} drifted by {size} {ends} ({sure})."
    if change.kind == "deviating":
        return f"{what} deviates by {size} in {flight_name(track, change.first)} only ({sure})."
    before = float(np.median(track.y[: change.first]))
    share = abs(change.size) / abs(before) if before else 0.0
    relative = f" ({100 * share:.2g} %)" if 0 < share < 1 else ""
    between = f"between {flight_name(track, change.last)} and {flight_name(track, change.first)}"
    many = "" if len(change.dates) == 1 else f", {len(change.dates)} dates possible"
    return f"{what} changed by {size}{relative} {between} ({sure}{many})."


def difference_sentence(quantity: str, d: Difference) -> str:
    """Return how far a rig's quantity is from the mean of the other rigs, as a sentence."""
    side = "above" if d.size > 0 else "below"
    chance = f"1 in {1 / d.p_value:.0f}" if d.p_value > 1e-6 else "less than 1 in a million"
    return (
        f"{d.rig}: {quantity} is {significant(abs(d.size), d.std)} {side} the mean of the "
        f"others, which scatter by {significant(d.std, d.std)} (chance if all rigs are alike: "
        f"{chance})."
    )


def remark_sentences(fleet: Fleet) -> Iterator[str]:
    """Yield sentences on unused recordings, missing start times, several plans, too few flights."""
    if fleet.bad:
        reasons = Counter(part for b in fleet.bad for part in _kinds_of_reason(b))
        stated = {part: b.reason for b in fleet.bad for part in _kinds_of_reason(b) if ": " in part}
        named = [
            f"{reason} ({n})" if n > 1 or reason not in stated else stated[reason].rstrip(".")
            for reason, n in reasons.most_common(MOST_REASONS)
        ]
        more = len(reasons) - len(named)
        named += [f"{more} more"] if more else []
        yield (
            f"{len(fleet.bad)} of {_count(fleet.recordings, 'recording')} "
            f"{'is' if len(fleet.bad) == 1 else 'are'} not used: {'; '.join(named)}."
        )
    if fleet.undated:
        yield (
            f"Flights of {', '.join(fleet.undated)} are in the order of their names, because "
            "starts (started_utc) are missing or equal."
        )
    plans = sorted({p for r in fleet.tracks() for p in r.track.plans.tolist()})
    if len(plans) > 1:
        several = ", ".join(p or "none" for p in plans)
        yield (
            f"Flights of different plans ({several}) are not compared with each other. Estimates "
            f"are of {fleet.plan or 'flights without a plan'}, the plan of most flights."
        )
    longest: dict[str, int] = {}
    for r in fleet.tracks():
        longest[r.track.rig] = max(longest.get(r.track.rig, 0), len(r.track.y))
    few = sorted(rig for rig, n in longest.items() if n < LEAST_FLIGHTS)
    if few:
        yield f"Fewer than {LEAST_FLIGHTS} flights, so no search for changes: {', '.join(few)}."


def _kinds_of_reason(bad: BadRecording) -> list[str]:
    """Return why a recording is not used: its failed integrity checks, or else its error message.

    In the message, "it" replaces the recording's path or name.

    >>> _kinds_of_reason(BadRecording("term/a.mcap", "r", "exit code 5: a holds pitch only."))
    ['exit code 5: it holds pitch only']
    >>> _kinds_of_reason(BadRecording("term/a.mcap", "r", "exit code 5: term/a.mcap is torn."))
    ['exit code 5: it is torn']
    >>> _kinds_of_reason(BadRecording("term/a.mcap", "r", "clock.gaps;clock.jitter"))
    ['clock.gaps', 'clock.jitter']
    """
    code, colon, error = bad.reason.partition(": ")
    if not colon:
        return bad.reason.split(";")
    names = "|".join(map(re.escape, (bad.recording, stem(Path(bad.recording)))))
    alone = rf"(?<![-\w])(?:{names})(?![-\w])"
    general = re.sub(alone, "it", error).rstrip(".")
    return [f"{code}: {general}"]


def flight_name(track: Track, flight: int) -> str:
    """Return the name and, if known, the date of a rig's flight with index ``flight`` (from 0)."""
    name = track.flights[flight]
    if not track.dated:
        return name
    return f"{name} ({date(track.t[flight])})"


def date(day: float) -> str:
    """Return the date of a time in days since 1970-01-01 UTC.

    >>> date(20703.4)
    '2026-09-07'
    """
    return f"{EPOCH + timedelta(days=float(day)):%Y-%m-%d}"


def signed_size(size: float, interval: tuple[float, float]) -> str:
    """Return a signed size ± half of its 95 % interval, to two significant digits of this half.

    >>> signed_size(-0.0612, (-0.0672, -0.0552))
    '−0.0612 ± 0.0060'
    """
    half = 0.5 * (interval[1] - interval[0])
    sign = "+" if size > 0 else ""
    return f"{sign}{significant(size, half)} ± {significant(half, half)}"


def percent(probability: float) -> str:
    """Return a probability in percent as text, above 99.9 % as ``> 99.9 %``.

    >>> percent(0.953), percent(0.99998)
    ('95 %', '> 99.9 %')
    """
    if probability > 0.999:
        return "> 99.9 %"
    return f"{100 * probability:.1f} %" if probability > 0.99 else f"{100 * probability:.0f} %"


def _count(n: int, noun: str) -> str:
    return f"{n} {noun}{'s' * (n != 1)}"


REPORT_LIMIT = f"Changes with a probability of at least {100 * REPORTED:.0f} % are reported."
