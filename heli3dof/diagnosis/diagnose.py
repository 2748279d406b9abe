"""`diagnose`: recordings in, a `Diagnosis` out. The order of things is the order of this file.

0. Integrity: a recording that is itself at fault is not diagnosed.
1. The base: the profile's rigid body or the paper's hover model, its T_g and inertias fitted and
   freed of the filter's bias (`estimate.bias_correction`).
2. The screen of every candidate, against simulated nulls of the recordings' own fit.
3. Causes one by one by full fits (`selection.select`); after each, its own correction,
   nulls and screen anew. Then backwards: what the others made superfluous goes.
4. What it gains on data not seen, against the base refitted; what does not pay goes.
5. What is left and has no name; names that only stood in for it go (`settle_unmodelled`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from heli3dof.diagnosis.conclusion.adoption import adopted, fitted
from heli3dof.diagnosis.conclusion.encoder_scales import LEVEL, undetectable_scales, with_scale_ties
from heli3dof.diagnosis.conclusion.inertia_ties import look_beside, with_confounded_causes
from heli3dof.diagnosis.conclusion.segments import with_segment_ties
from heli3dof.diagnosis.conclusion.stand_ins import base_with_residual
from heli3dof.diagnosis.conclusion.unnamed import Settled, settle_unmodelled
from heli3dof.diagnosis.estimate.base_fit import BASES, fit_base
from heli3dof.diagnosis.estimate.base_parameters import (
    OffNominal,
    base_parameters,
    doubt,
    off_nominal,
)
from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit
from heli3dof.diagnosis.estimate.setup import Setup
from heli3dof.diagnosis.free_run.diagnose_free_run import diagnose_real, no_likelihood
from heli3dof.diagnosis.free_run.recordings_agree import marked_unsure
from heli3dof.diagnosis.integrity import Kind, integrity
from heli3dof.diagnosis.result import (
    Diagnosis,
    Finding,
    in_order,
    physical,
    tied_in,
    verdict_of,
)
from heli3dof.diagnosis.selection.alternatives import alternatives, first_that_flies
from heli3dof.diagnosis.selection.companions import best_with_companion
from heli3dof.diagnosis.selection.select import MAX_CAUSES, detectable_size
from heli3dof.diagnosis.selection.steps import (
    Step,
    as_written,
    backward_elimination,
    screening_step,
)
from heli3dof.errors import UsageError, did_you_mean
from heli3dof.model.effects import term
from heli3dof.parallel import report_progress
from heli3dof.recording.logs.sampling_clock import sampling_times
from heli3dof.recording.recording import Recording

FLIGHTS, QUICK_FLIGHTS = 64, 16
FURTHER = 0.5
"""Of the flights, for the nulls after the first finding."""
PILOTS, QUICK_PILOTS = 12, 6
LEFT_FLIGHTS, QUICK_LEFT_FLIGHTS = 24, 8
SAID_EVERY_S = 1.0
Says = Callable[[str], None]


def diagnose(
    recordings: Recording | Sequence[Recording],
    holdout: Recording | Sequence[Recording] | None = None,
    *,
    quick: bool = False,
    seed: int = 0,
    says: Says = lambda sentence: None,
    base: str = "rigid",
) -> Diagnosis:
    """What the simulation of these recordings gets wrong, and why.

    ``base`` is the simulation that is judged: "rigid", the nonlinear rigid body, or "hover", the
    paper's linear model, beside which the rigid body is one more candidate, ``geometry``.
    ``quick`` simulates `QUICK_FLIGHTS` nulls instead of `FLIGHTS`, and where none can be flown
    leaves no blocks out. Without ``holdout`` the gains
    are measured on blocks left out, and the document says so. Raises RecordingError
    where nothing can be fitted, UsageError for a base that there is not.
    """
    if base not in BASES:
        raise UsageError(
            f"There is no base simulation {base!r}.",
            cause=f"a typing error; {did_you_mean(base, list(BASES))}",
            fix=f"one of {', '.join(BASES)}",
        )
    train = [recordings] if isinstance(recordings, Recording) else list(recordings)
    held = [] if holdout is None else [holdout] if isinstance(holdout, Recording) else list(holdout)
    clock = Clock(says)
    with report_progress(clock.counts):
        return _diagnosed(train, held, clock, quick=quick, seed=seed, base=base)


def _diagnosed(
    train: list[Recording], held: list[Recording], clock: Clock, *, quick: bool, seed: int,
    base: str,
) -> Diagnosis:  # fmt: skip
    names = (tuple(r.name for r in train), tuple(r.name for r in held))
    clock.start("integrity", "Checking the recordings …")
    faults = integrity([*train, *held])
    for stops in (Kind.BAD_DATA, Kind.NOT_IDENTIFIABLE):
        if any(f.kind == stops for f in faults):
            return Diagnosis(*names, stops, faults)
    train, held = [*map(sampling_times, train)], [*map(sampling_times, held)]
    if why := no_likelihood(train):
        return diagnose_real(
            train, held, faults, why=why, base=base, quick=quick, seed=seed, says=clock.says
        )
    flights = QUICK_FLIGHTS if quick else FLIGHTS
    bench = Setup(tuple(train), seed, QUICK_PILOTS if quick else PILOTS, base, not quick)
    clock.start("base", "Fitting the base simulation and simulating its bias …")
    least = fit_base(bench)
    steps, found = causes(bench, least, flights, clock)
    first = steps[0]
    clock.start("backward", "Refitting without each cause …")
    found, steps = backward_elimination(bench, found, steps)
    clock.start("gain", "Measuring the gain on held-out data …")
    taken = [s.choice for s in steps if s.choice is not None and not s.choice.term.effect.formal]
    found, findings, dropped, after = adopted(
        found, taken, held, seed=seed, instead=partial(alternatives, bench)
    )
    clock.start("left", "Searching for unmodelled effects …")
    many = QUICK_LEFT_FLIGHTS if quick else LEFT_FLIGHTS
    last = settle_unmodelled(bench, Settled(found, findings, dropped, after), held, flights=many)
    last = replace(last, findings=with_segment_ties(last.findings))
    if not bench.controller_is_known:
        clock.says("Fitting each recording separately …")
        last = replace(last, findings=marked_unsure(last.findings, train))
    clock.start("gain", "Measuring the gain on held-out data …")
    least = as_written(least, last.found)
    whole = fitted(least, last.found, last.after, train, held, seed=seed)
    clock.start("off", "Comparing the calibration with the profile …")
    off = base_off(last) if last.sure else ()
    off = tuple(with_confounded_causes(o, look_beside(steps, last.found)) for o in off)
    profile = train[0].profile
    findings, off = with_scale_ties(
        last.findings, off, base_parameters(last.found),
        rest_rad=float(profile.encoder.rest_rad[0]), tolerance=profile.tolerance,
    )  # fmt: skip
    clock.stop()
    about = {
        "nulls": first.nulls.method, "null_flights": first.nulls.flights, "seed": seed,
        "threshold": first.nulls.threshold, "largest": first.largest,
        "gain_measured_on": whole.gain.on, "base": base, "seconds": clock.seconds,
        "written": [t.effect.summary for t in last.found.structure.formal],
    }  # fmt: skip
    sized = [f for f in faults if f.kind == Kind.FINDING]
    each = in_order(sized, findings, off)
    dark = undetectable_scales(
        tied_in(each), bench.axes, rest_rad=float(profile.encoder.rest_rad[0]),
        tolerance=profile.tolerance, level_deg=detectable_size(first.screen, first.nulls, LEVEL),
    )  # fmt: skip
    like = any(isinstance(f, Finding) and f.like for f in physical(each)[:1])
    unsure = like and not bench.controller_is_known
    return Diagnosis(
        *names, verdict_of(each, last.left, whole.refit, unsure=unsure), faults, whole,
        findings, off, last.dropped, last.left,
        (*(n for n in first.unseen if not term(n).effect.formal), *dark), about,
    )  # fmt: skip


def base_off(last: Settled) -> tuple[OffNominal, ...]:
    """The base's numbers that are off nominal, beside what is left."""
    beside = (
        None if last.held is None or not last.left else base_with_residual(last.found, last.held)
    )
    return off_nominal(last.found, doubted=doubt(last.found), beside=beside)


def causes(
    bench: Setup, base: CorrectedFit, flights: int, clock: Clock
) -> tuple[list[Step], CorrectedFit]:
    """Forward: every step that was made (the last one found nothing, or is the last allowed)."""
    found, steps = base, list[Step]()
    # An inertia far off is a first cause too, whose formula (where its mass sits) is a guess.
    off = off_nominal(base, doubted=doubt(base))
    inertias = [o.flight_score for o in off if o.term.effect.name == "inertia"]
    score, left = max(inertias, default=None), MAX_CAUSES
    while left:
        n = flights if not steps else max(8, round(FURTHER * flights))
        nulls = f"against {n} simulated nulls" if bench.controller_is_known else "every candidate"
        clock.start(f"screen {len(steps) + 1}", f"Screening {nulls} …")
        step = screening_step(bench, found, n)
        clock.start(f"fits {len(steps) + 1}", "Fitting what may be the cause …")
        step = step.chosen(bench, score)
        steps.append(step)
        if step.choice is None:
            break
        made: Mapping[str, CorrectedFit] = {}
        if bench.opinions and bench.controller_is_known:
            likelier, made = best_with_companion(bench, step)
            step = replace(step, choice=likelier)
        choice, wider = first_that_flies(bench, step, score, made)
        steps[-1] = replace(step, choice=choice)
        if choice is None or wider is None:
            break
        clock.says(f"Found {choice.term.name}.")
        found = wider
        if not choice.term.effect.of_base:  # what a simpler base lacks is no cause in the rig
            left -= 1
            if choice.contenders[0].probe is not None:  # a tried term's formula leaves nothing
                score = choice.score if score is None else max(score, choice.score)
    return steps, found


class Clock:
    """Says what is being done, and keeps the wall clock of each stage."""

    def __init__(self, says: Says) -> None:
        self.says = says
        self.seconds: dict[str, float] = {}
        self._stage, self._since = "", time.perf_counter()
        self._sentence, self._said = "", self._since

    def start(self, stage: str, sentence: str) -> None:
        self.stop()
        self._stage, self._sentence, self._said = stage, sentence, self._since
        self.says(sentence)

    def counts(self, what: str, done: int, of: int) -> None:
        """Of a stage that lasts, every `SAID_EVERY_S`: ``… flights: 31 of 64``."""
        now = time.perf_counter()
        if now - self._said >= SAID_EVERY_S:
            self._said = now
            self.says(f"{self._sentence} {what}: {done} of {of}")

    def stop(self) -> None:
        now = time.perf_counter()
        if self._stage:
            before = self.seconds.get(self._stage, 0.0)
            self.seconds[self._stage] = round(before + now - self._since, 2)
        self._stage, self._since = "", now
