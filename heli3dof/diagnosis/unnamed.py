"""What has no name, and names that only stood in for it: looked for in turns until both settle.

First each set of names competes with one free-form torque (`heli3dof.diagnosis.rivals`), then the
torques that are left are looked for (`leftover`), then names that lose their size beside them
(`proxies`). Names that stood in go, the others are settled and measured again, and so is the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from heli3dof.diagnosis.corrected import Corrected
from heli3dof.diagnosis.gain import HeldOut
from heli3dof.diagnosis.leftover import Leftover, taken
from heli3dof.diagnosis.leftover_evidence import Held, evidence
from heli3dof.diagnosis.measured import adopted
from heli3dof.diagnosis.proxies import doubted, named_like, stand_ins
from heli3dof.diagnosis.result import STANDS_IN, Dropped, Finding
from heli3dof.diagnosis.rivals import rival
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


def unnamed(bench: Bench, start: Settled, holdout: Sequence[Recording], *, flights: int) -> Settled:
    """``start`` is what was adopted; ``flights``: simulated nulls of each look."""
    now, posed, doubtful = start, list[str](), set[str]()
    before = start
    while True:
        names = [f.choice.term.name for f in now.findings if not f.choice.term.effect.within]
        seen = evidence(now.found, bench.recordings, flights=flights, seed=bench.seed)
        best = rival(seen, [n for n in names if n not in doubtful])
        if best is not None:
            posing = best.names
        else:
            left, held = taken(seen)
            posing = stand_ins(now.findings, now.found, left, held)
        if not posing:
            if posed and not left:  # a stand-in for nothing: say the names, but not as sure
                now, doubtful, posed = before, {*doubtful, *posed}, []
                continue
            findings = doubted(now.findings, now.found, left, held)
            findings = tuple(
                replace(f, like=f.like or f.choice.term.name in doubtful) for f in findings
            )
            return replace(now, findings=findings, left=named_like(left, posed), held=held)
        posed += posing
        now = _less(bench, now, posing, holdout)


def _less(
    bench: Bench, now: Settled, posing: Sequence[str], holdout: Sequence[Recording]
) -> Settled:
    """The same without these names: refitted, measured again."""
    kept = [f.choice for f in now.findings if f.choice.term.name not in posing]
    gains = {f.choice.term.name: f.gain for f in now.findings}
    found = now.found
    for f in now.findings:
        if f.choice.term.name in posing:
            found = without(found, f.choice.term)
    found, findings, poor, after = adopted(
        settled_again(bench, found), kept, holdout, seed=bench.seed
    )
    gone = tuple(Dropped(n, gains[n], STANDS_IN) for n in posing)
    return Settled(found, findings, (*now.dropped, *gone, *poor), after)
