"""What has no name, and names that only stood in for it: looked for in turns until both settle.

First each set of names competes with one free-form torque (`heli3dof.diagnosis.competition`), then
the torques that are left are looked for (`leftover`), then names that lose their size beside them
(`proxies`). Names that stood in go, the others are settled and measured again, and so is the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from heli3dof.diagnosis.competition import as_leftover, held_with, rival
from heli3dof.diagnosis.corrected import Corrected
from heli3dof.diagnosis.gain import HeldOut
from heli3dof.diagnosis.leftover import Leftover, taken
from heli3dof.diagnosis.leftover_evidence import Held, evidence
from heli3dof.diagnosis.measured import adopted
from heli3dof.diagnosis.proxies import doubted, named_like, stand_ins
from heli3dof.diagnosis.result import STANDS_IN, Dropped, Finding
from heli3dof.diagnosis.steps import Bench, settled_again, without
from heli3dof.recording.recording import Recording


@dataclass(frozen=True, eq=False)
class Settled:
    """The fit with the causes that keep their names, and what is left beside them."""

    found: Corrected
    findings: tuple[Finding, ...]
    dropped: tuple[Dropped, ...]
    after: HeldOut
    left: tuple[Leftover, ...] = ()
    held: Held | None = None
    """The fit's coordinates and the leftovers"""
    sure: bool = True
    """False where nothing in the fit is: neither its names nor the base's numbers"""


def unnamed(bench: Bench, start: Settled, holdout: Sequence[Recording], *, flights: int) -> Settled:
    """``start`` is what was adopted; ``flights``: simulated nulls of each look."""
    if start.found.scatter is None:  # it may fly now that something was not adopted
        again = settled_again(bench, start.found)
        start = start if again.scatter is None else _measured(bench, start, again, (), holdout)
    now, posed = start, list[str]()
    first: tuple[tuple[Leftover, ...], Held] | None = None
    while True:
        seen = evidence(now.found, bench.recordings, flights=flights, seed=bench.seed)
        best = rival(seen, named(now.findings))
        if best is None:
            left, held = taken(seen)
            posing = stand_ins(now.findings, now.found, left, held)
        else:
            left, held = (as_leftover(seen, best),), held_with(seen, best)
            posing = best.names
        if not posing:
            break
        first = first or (left, held)
        posed += posing
        now = _less(bench, now, posing, holdout)
    if first and not left:
        return _uncertain(start, *first, posed)
    findings = doubted(now.findings, now.found, left, held)
    return replace(now, findings=findings, left=named_like(left, posed), held=held)


def named(findings: Sequence[Finding]) -> list[str]:
    """The names that may be stand-ins: not what a simpler base leaves out."""
    return [f.choice.term.name for f in findings if not f.choice.term.effect.of_base]


def _uncertain(
    start: Settled, left: tuple[Leftover, ...], held: Held, posed: Sequence[str]
) -> Settled:
    """Where without the names nothing can be seen to be left (too little holds the fit then):
    both are told, and neither a name nor a number is sure."""
    findings = tuple(replace(f, like=True) for f in start.findings)
    return replace(start, findings=findings, left=named_like(left, posed), held=held, sure=False)


def _less(
    bench: Bench, now: Settled, posing: Sequence[str], holdout: Sequence[Recording]
) -> Settled:
    """The same without these names: refitted, measured again."""
    found = now.found
    for f in now.findings:
        if f.choice.term.name in posing:
            found = without(found, f.choice.term)
    return _measured(bench, now, settled_again(bench, found), posing, holdout)


def _measured(
    bench: Bench, now: Settled, found: Corrected, posing: Sequence[str],
    holdout: Sequence[Recording],
) -> Settled:  # fmt: skip
    """What of the other names still pays, and has a size, in this fit without those ``posing``."""
    kept = [f.choice for f in now.findings if f.choice.term.name not in posing]
    gains = {f.choice.term.name: f.gain for f in now.findings}
    found, findings, poor, after = adopted(found, kept, holdout, seed=bench.seed)
    gone = tuple(Dropped(n, gains[n], STANDS_IN) for n in posing)
    return Settled(found, findings, (*now.dropped, *gone, *poor), after)
