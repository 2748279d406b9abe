"""Search for unmodelled torques, and remove names that only stood in for one, until both settle.

Each set of names first competes with one free-form torque (`unmodelled.competition`). Then further
residual torques are searched for, and names are removed that lose their size when the fit contains
these torques (`stand_ins`). The remaining causes are fitted and measured again, and the search is
repeated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from heli3dof.diagnosis.conclusion.adoption import adopted
from heli3dof.diagnosis.conclusion.stand_ins import marked_unsure, stand_ins, with_resemblance
from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit
from heli3dof.diagnosis.estimate.setup import Setup
from heli3dof.diagnosis.result import STANDS_IN, Dropped, Finding
from heli3dof.diagnosis.selection.steps import bias_corrected_again, without
from heli3dof.diagnosis.unmodelled.competition import as_leftover, held_with, winning_torque
from heli3dof.diagnosis.unmodelled.torque_evidence import Held, evidence
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque, significant_torques
from heli3dof.diagnosis.validation.gain import HeldOut
from heli3dof.recording.recording import Recording


@dataclass(frozen=True, eq=False)
class Settled:
    """The fit with the causes that keep their names, and what is left beside them."""

    found: CorrectedFit
    findings: tuple[Finding, ...]
    dropped: tuple[Dropped, ...]
    after: HeldOut
    left: tuple[ResidualTorque, ...] = ()
    held: Held | None = None
    """The fit's coordinates and the leftovers"""
    sure: bool = True
    """False where nothing in the fit is: neither its names nor the base's numbers"""


def settle_unmodelled(
    bench: Setup, start: Settled, holdout: Sequence[Recording], *, flights: int
) -> Settled:
    """``start`` is what was adopted; ``flights``: simulated nulls of each look."""
    if start.found.scatter is None:  # it may fly now that something was not adopted
        again = bias_corrected_again(bench, start.found)
        start = start if again.scatter is None else _measured(bench, start, again, (), holdout)
    now, posed = start, list[str]()
    first: tuple[tuple[ResidualTorque, ...], Held] | None = None
    while True:
        seen = evidence(now.found, bench.recordings, flights=flights, seed=bench.seed)
        best = winning_torque(seen, named(now.findings))
        if best is None:
            left, held = significant_torques(seen)
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
    findings = marked_unsure(now.findings, now.found, left, held)
    return replace(now, findings=findings, left=with_resemblance(left, posed), held=held)


def named(findings: Sequence[Finding]) -> list[str]:
    """The names that may be stand-ins: not what a simpler base leaves out."""
    return [f.choice.term.name for f in findings if not f.choice.term.effect.of_base]


def _uncertain(
    start: Settled, left: tuple[ResidualTorque, ...], held: Held, posed: Sequence[str]
) -> Settled:
    """Where without the names nothing can be seen to be left (too little holds the fit then):
    both are told, and neither a name nor a number is sure."""
    findings = tuple(replace(f, like=True) for f in start.findings)
    return replace(
        start, findings=findings, left=with_resemblance(left, posed), held=held, sure=False
    )


def _less(
    bench: Setup, now: Settled, posing: Sequence[str], holdout: Sequence[Recording]
) -> Settled:
    """The same without these names: refitted, measured again."""
    found = now.found
    for f in now.findings:
        if f.choice.term.name in posing:
            found = without(found, f.choice.term)
    return _measured(bench, now, bias_corrected_again(bench, found), posing, holdout)


def _measured(
    bench: Setup, now: Settled, found: CorrectedFit, posing: Sequence[str],
    holdout: Sequence[Recording],
) -> Settled:  # fmt: skip
    """What of the other names still pays, and has a size, in this fit without those ``posing``."""
    kept = [f.choice for f in now.findings if f.choice.term.name not in posing]
    gains = {f.choice.term.name: f.gain for f in now.findings}
    found, findings, poor, after = adopted(found, kept, holdout, seed=bench.seed)
    gone = tuple(Dropped(n, gains[n], STANDS_IN) for n in posing)
    return Settled(found, findings, (*now.dropped, *gone, *poor), after)
