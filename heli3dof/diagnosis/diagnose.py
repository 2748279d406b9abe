"""`diagnose`: recordings in, a `Diagnosis` out. The order of things is the order of this file.

1. The base: the profile's rigid body, its T_g and inertias fitted and freed of the filter's bias
   (`heli3dof.diagnosis.corrected`).
2. The screen of every candidate, against simulated nulls of the recordings' own fit.
3. Causes one by one by full fits (`heli3dof.diagnosis.select`); after each, its own correction,
   nulls and screen anew. Then backwards: what the others made superfluous goes.
4. What it gains on held-out recordings, against the base refitted.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from heli3dof.diagnosis.corrected import Corrected, model_at
from heli3dof.diagnosis.gain import log_likelihood, noise_floor_deg, rmse_deg
from heli3dof.diagnosis.select import MOST, Choice
from heli3dof.diagnosis.steps import Bench, Step, base_of, eliminated, extended, looked_at, without
from heli3dof.identification.greybox.method import model_of
from heli3dof.model.greybox import GreyBoxModel, nominal
from heli3dof.recording.recording import Recording

FLIGHTS, QUICK_FLIGHTS = 64, 16
FURTHER = 0.5
"""Of the flights, for the nulls after the first finding."""
PILOTS, QUICK_PILOTS = 12, 6
Says = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Finding:
    """A cause: its term, the step in which it was taken, and what it gains on the test flights."""

    choice: Choice
    values: dict[str, tuple[float, float]]
    """Parameter → (value, standard deviation) in the final fit"""
    before: dict[str, float | None]
    after: dict[str, float | None]
    log_likelihood: float


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What was found; `heli3dof.diagnosis.document` makes the contract's JSON of it."""

    recordings: tuple[str, ...]
    holdout: tuple[str, ...]
    verdict: str
    base: Corrected
    final: Corrected
    findings: tuple[Finding, ...]
    calibration_findings: tuple[str, ...]
    simulation_error: dict[str, float | None]
    before: dict[str, float | None]
    after: dict[str, float | None]
    noise_floor: dict[str, float | None]
    not_identifiable: tuple[str, ...]
    model: GreyBoxModel
    about: dict[str, Any] = field(default_factory=dict)


def diagnose(
    recordings: Recording | Sequence[Recording],
    holdout: Recording | Sequence[Recording] | None = None,
    *,
    quick: bool = False,
    seed: int = 0,
    says: Says = lambda sentence: None,
) -> Diagnosis:
    """What the simulation of these recordings gets wrong, and why.

    ``quick`` simulates `QUICK_FLIGHTS` nulls instead of `FLIGHTS`. Without ``holdout`` the gains
    are measured on the recordings themselves, and the document says so. Raises RecordingError
    where nothing can be fitted.
    """
    train = [recordings] if isinstance(recordings, Recording) else list(recordings)
    held = [] if holdout is None else [holdout] if isinstance(holdout, Recording) else list(holdout)
    clock = Clock(says)
    flights = QUICK_FLIGHTS if quick else FLIGHTS
    bench = Bench(tuple(train), seed, QUICK_PILOTS if quick else PILOTS)
    clock.start("base", "Fitting the base simulation, and flying it for its bias …")
    base = base_of(bench)
    steps, found = causes(bench, base, flights, clock)
    clock.start("backward", "Each cause once more without it …")
    found, steps = eliminated(bench, found, steps)
    clock.start("gain", "Measuring what it gains …")
    test = held or train
    model, plain = model_of(found, train, "extended"), _flown(base)
    before, after = rmse_deg(plain, test), rmse_deg(model, test)
    taken = [s.choice for s in steps if s.choice is not None]
    findings = tuple(_finding(found, c, model, after, test) for c in taken)
    first = steps[0] if steps else looked_at(bench, base, flights)
    off = _off_nominal(found)
    error, floor = rmse_deg(nominal(train[0].profile), test), noise_floor_deg(model, test, seed)
    clock.stop()
    return Diagnosis(
        tuple(r.name for r in train), tuple(r.name for r in held), _verdict(findings, off),
        base, found, findings, off, error, before, after, floor, first.unseen, model,
        {"nulls": first.nulls.method, "null_flights": first.nulls.flights, "seed": seed,
         "threshold": first.nulls.threshold, "largest": first.largest,
         "gain_measured_on": "holdout" if held else "the recordings themselves",
         "seconds": clock.seconds},
    )  # fmt: skip


def causes(
    bench: Bench, base: Corrected, flights: int, clock: Clock
) -> tuple[list[Step], Corrected]:
    """Forward: every step that was made (the last one found nothing, or is the last allowed)."""
    found, steps = base, list[Step]()
    score = None
    while len(steps) < MOST:
        n = flights if not steps else max(8, round(FURTHER * flights))
        clock.start(f"screen {len(steps) + 1}", f"Screening against {n} simulated nulls …")
        step = looked_at(bench, found, n)
        clock.start(f"fits {len(steps) + 1}", "Fitting what may be the cause …")
        step = step.chosen(bench, score)
        steps.append(step)
        if step.choice is None:
            break
        clock.says(f"Found {step.choice.term.name}.")
        found = extended(bench, step.choice)
        score = score or step.choice.score
    return steps, found


class Clock:
    """Says what is being done, and keeps the wall clock of each stage."""

    def __init__(self, says: Says) -> None:
        self.says = says
        self.seconds: dict[str, float] = {}
        self._stage, self._since = "", time.perf_counter()

    def start(self, stage: str, sentence: str) -> None:
        self.stop()
        self._stage = stage
        self.says(sentence)

    def stop(self) -> None:
        now = time.perf_counter()
        if self._stage:
            before = self.seconds.get(self._stage, 0.0)
            self.seconds[self._stage] = round(before + now - self._since, 2)
        self._stage, self._since = "", now


def _finding(
    found: Corrected, choice: Choice, model: GreyBoxModel, after: dict[str, float | None],
    test: Sequence[Recording],
) -> Finding:  # fmt: skip
    less = _flown(without(found, choice.term))
    return Finding(
        choice, _values(found, choice), rmse_deg(less, test), after,
        log_likelihood(model, test) - log_likelihood(less, test),
    )  # fmt: skip


def _flown(found: Corrected) -> GreyBoxModel:
    return model_at(found.problem, found.optimum.theta, found.optimum.noise)


def _values(found: Corrected, choice: Choice) -> dict[str, tuple[float, float]]:
    return {
        f.name.removeprefix(choice.term.name + "."): (float(v), float(s))
        for f, v, s in zip(found.free, found.values, found.std, strict=True)
        if f.term == choice.term.name
    }


def _off_nominal(found: Corrected) -> tuple[str, ...]:
    """Base parameters off by more than the profile's tolerance, surely (two standard deviations).

    All in units of K_f: where they are all off together by one factor, K_f is what is off.
    """
    tolerance = found.structure.profile.tolerance
    ratio = np.array([v / f.start for f, v in zip(found.free[:4], found.values[:4], strict=True)])
    spread = found.std[:4] / np.abs([f.start for f in found.free[:4]])
    off = np.abs(ratio - 1) - 2 * spread > tolerance
    common = float(np.median(ratio))
    if abs(common - 1) > tolerance and (np.abs(ratio / common - 1) < tolerance).all():
        return ("motor.thrust_gain",) if off.any() else ()
    names = ("mass.imbalance", "inertia.roll", "inertia.pitch", "inertia.yaw")
    return tuple(n for n, bad in zip(names, off, strict=True) if bad)


def _verdict(findings: Sequence[Finding], off: Sequence[str]) -> str:
    if findings:
        return "ambiguous" if findings[0].choice.tied_with else "explained"
    return "explained" if off else "nothing_found"
