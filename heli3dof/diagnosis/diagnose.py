"""Diagnose recordings: find the causes of simulation errors, and measure the gain of each.

The gain of a cause is the decrease of the prediction error if the model contains the cause.

1. Integrity checks: a faulty recording is not diagnosed.
2. Base fit: the trim torque T_g and the inertias of the rigid body (or of the paper's hover model)
   are estimated and bias-corrected (`bias_correction.correction`).
3. Forward selection (`search.select`): a score test of all candidate effects, compared with flights
   simulated without them; then refits with each of the best candidates added. Both are repeated
   after each cause.
4. Gain: causes that do not improve the prediction of held-out data are dropped. If all are dropped,
   step 3 is repeated without them.
5. Residual torques: search for unmodelled torques. Causes that only compensated for one of them are
   dropped (`conclusion.compensating_causes`). The model is extended by a term for each torque
   (`conclusion.torque_terms`). Then steps 3 to 5 are repeated with these terms, as long as a
   further cause is adopted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from heli3dof.diagnosis.base_parameters import off_nominal
from heli3dof.diagnosis.conclusion.adoption import AdoptionResult, adopted, fitted
from heli3dof.diagnosis.conclusion.compensating_causes import (
    search_residual_torques,
)
from heli3dof.diagnosis.conclusion.confounded_encoder_scales import ROLL_OFFSET
from heli3dof.diagnosis.conclusion.confounded_parameters import (
    last_step_with_causes,
    with_confounded_causes,
)
from heli3dof.diagnosis.conclusion.doubtful_findings import (
    marked_if_doubtful,
    with_segment_ties,
)
from heli3dof.diagnosis.conclusion.torque_terms import with_sizes, with_torques
from heli3dof.diagnosis.conclusion.unknown_controller import confirmed
from heli3dof.diagnosis.conclusion.verdict import conclude
from heli3dof.diagnosis.constants import MAX_CAUSES
from heli3dof.diagnosis.free_run.diagnose_free_run import (
    PREDICTS_WORSE,
    can_be_fitted,
    diagnose_without_likelihood,
    no_likelihood,
)
from heli3dof.diagnosis.result import Diagnosis, Dropped
from heli3dof.diagnosis.search.select import Choice
from heli3dof.diagnosis.search.steps import (
    Step,
    base_with_forms,
    fit_with_cause,
    screening_step,
    with_rivals_that_remain,
)
from heli3dof.errors import UsageError, did_you_mean
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.closed_loop_fit.base_fit import BASES, fit_base
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.integrity import Kind, integrity
from heli3dof.model.control.voltage_replay import with_known_controller
from heli3dof.model.effects import term
from heli3dof.parallel import report_progress
from heli3dof.recording.distinct_samples import check_distinct
from heli3dof.recording.logs.corrections import corrected
from heli3dof.recording.provenance import exercise_ids, rig_to_fly
from heli3dof.recording.recording import Recording
from heli3dof.recording.same_rig import check_same_rig
from heli3dof.stage_clock import Progress, StageClock


class Effort(NamedTuple):
    """Numbers of simulated flights. Chosen."""

    nulls: int
    """Null simulations (flights without any further effect) of the first score test"""
    later_nulls: int
    """Null simulations of each further score test"""
    correction: int
    """Flights of a bias correction"""
    torque_nulls: int
    """Null simulations of the torque search"""


FULL, QUICK = Effort(64, 32, 12, 24), Effort(16, 8, 6, 8)


def diagnose(
    recordings: Recording | Sequence[Recording],
    holdout: Recording | Sequence[Recording] | None = None,
    *,
    quick: bool = False,
    seed: int = 0,
    progress: Progress = lambda sentence: None,
    base: str = "rigid",
) -> Diagnosis:
    """Return how well a simulation predicts these recordings, and the causes of its errors.

    ``base``: the simulation to diagnose, "rigid" (nonlinear rigid body) or "hover" (the paper's
    linear model). With "hover", the complete rigid-body equations may be found as a cause
    (``geometry``). ``holdout``: recordings on which to measure how much each cause improves the
    predictions. Without them, this is measured by cross-validation. ``quick``: fewer simulated
    flights (`QUICK` instead of `FULL`). If the likelihood of the recordings is not reliable,
    ``quick`` also omits cross-validation. ``seed``: random seed of the simulated flights and of
    the bootstrap. ``progress`` receives progress messages.

    Raises RecordingError if nothing can be fitted. Raises UsageError if ``base`` is unknown, if two
    recordings contain the same samples, or if they are of different rigs.
    """
    if base not in BASES:
        raise UsageError(
            f"There is no base simulation {base!r}.",
            cause=f"a typing error; {did_you_mean(base, list(BASES))}",
            fix=f"one of {', '.join(BASES)}",
        )
    train = [recordings] if isinstance(recordings, Recording) else list(recordings)
    held = [] if holdout is None else [holdout] if isinstance(holdout, Recording) else list(holdout)
    check_same_rig([*train, *held])
    check_distinct(train, held)
    clock = StageClock(progress)
    with report_progress(clock.counts):
        found = _diagnosed(train, held, clock, quick=quick, seed=seed, base=base)
    return replace(found, about={**found.about, **_rig([*train, *held])})


def _rig(recordings: Sequence[Recording]) -> dict[str, Any]:
    """Return the entries of `Diagnosis.about` that identify the rig: exercises, device, profile."""
    ids = exercise_ids(recordings)
    return {**({} if ids is None else {"exercises": ids}), **rig_to_fly(recordings)}


def _diagnosed(
    train: list[Recording], held: list[Recording], clock: StageClock, *, quick: bool, seed: int,
    base: str,
) -> Diagnosis:  # fmt: skip
    names = (tuple(r.name for r in train), tuple(r.name for r in held))
    clock.start("integrity", "Checking the recordings …")
    faults = integrity([*train, *held])
    for stops in (Kind.BAD_DATA, Kind.NOT_IDENTIFIABLE):
        if any(f.kind == stops for f in faults):
            return Diagnosis(*names, stops, faults)
    train, held = ([with_known_controller(corrected(r)) for r in x] for x in (train, held))

    def without_likelihood(why: str) -> Diagnosis:
        return diagnose_without_likelihood(
            train, held, faults, why=why, base=base, quick=quick, seed=seed, progress=clock.progress
        )

    if why := no_likelihood(train):
        return without_likelihood(why)
    effort = QUICK if quick else FULL
    setup = Setup(tuple(train), seed, effort.correction, base)
    clock.start("base", "Fitting the base simulation and simulating its bias …")
    base_fit = fit_base(setup)
    steps, settled = search_causes(setup, base_fit, (), held, effort, clock)
    first = steps[0]
    while True:
        clock.start("left", "Searching for unmodelled effects …")
        settled = search_residual_torques(setup, settled, held, flights=effort.torque_nulls)
        terms = len(settled.modelled_torques)
        if len(settled.residual_torques) > terms:
            clock.start("torque terms", "Extending the model by the unmodelled torque …")
            settled = with_torques(setup, settled, held)
        if len(settled.modelled_torques) == terms or not settled.is_decided:
            break
        causes = settled.choices
        further, again = search_causes(setup, settled.fit, causes, held, effort, clock)
        steps += further
        settled = settled.with_causes_of(again)
        if {c.term.name for c in settled.choices} <= {c.term.name for c in causes}:
            break
    settled = with_sizes(settled)
    findings = marked_if_doubtful(with_segment_ties(settled.findings), setup, settled.fit)
    settled = replace(settled, findings=findings)
    clock.start("gain", "Measuring the gain on held-out data …")
    base_fit = base_with_forms(base_fit, settled.fit)
    result = fitted(base_fit, settled, train, held, seed=seed)
    if result.predicts_worse and can_be_fitted(train):
        return without_likelihood(PREDICTS_WORSE)
    clock.start("off", "Comparing the calibration with the profile …")
    off = off_nominal(settled.fit) if settled.is_decided else ()
    if not settled.fit.is_corrected:
        off = confirmed(off, settled.fit, settled.after, held, seed=seed)
    off = with_confounded_causes(off, last_step_with_causes(steps, settled.fit))
    clock.stop()
    about = {
        "nulls": first.nulls.method, "null_flights": first.nulls.flights, "seed": seed,
        "threshold": first.nulls.threshold, "largest": first.largest,
        "gain_measured_on": result.gain.on, "base": base, "seconds": clock.seconds,
        "written": [t.effect.summary for t in settled.fit.structure.formal],
        "converged": settled.fit.optimum.converged,
    }  # fmt: skip
    without_verdict = Diagnosis(
        *names, "", faults, result, settled.findings, off, settled.dropped,
        residual_torques=settled.residual_torques, slow_noise=settled.slow_noise, about=about,
        not_identifiable=tuple(n for n in first.not_identifiable if not term(n).effect.formal),
    )  # fmt: skip
    return conclude(
        without_verdict, setup.axes, detectable_offset_deg=first.detectable_size(ROLL_OFFSET)
    )


def search_causes(
    setup: Setup, start: CorrectedFit, earlier: Sequence[Choice], holdout: Sequence[Recording],
    effort: Effort, clock: StageClock,
) -> tuple[list[Step], AdoptionResult]:  # fmt: skip
    """Return all steps of forward selection, and the causes that are adopted after it.

    The search begins at the fit ``start``, which contains the ``earlier`` causes. Held-out data
    test these causes and the new ones (`conclusion.adoption`). If all are dropped, another effect
    may be the cause. So the search is repeated without the dropped causes, until a cause is adopted
    or none is found.
    """
    steps, dropped = list[Step](), list[Dropped]()
    while True:
        search, fit = forward_selection(setup, start, earlier, effort, clock)
        steps += search
        choices = [s.choice for s in search if s.choice is not None]
        found = [c for c in choices if not c.term.effect.formal]
        clock.start("gain", "Testing the candidates on held-out data …")
        settled = adopted(fit, [*earlier, *found], holdout, seed=setup.seed)
        dropped += settled.dropped
        if settled.findings or not found:
            return steps, replace(settled, dropped=tuple(dropped))
        setup = replace(setup, refuted=tuple(d.name for d in dropped))


def forward_selection(
    setup: Setup, start: CorrectedFit, earlier: Sequence[Choice], effort: Effort, clock: StageClock
) -> tuple[list[Step], CorrectedFit]:
    """Return (steps of forward selection, final fit).

    Each step adds one cause to the fit ``start``, which contains the ``earlier`` causes. In the
    last step, ``choice`` may be None: there was no further significant effect.
    """
    fit, steps = start, list[Step]()
    # An inertia off nominal counts as an earlier cause (rule 4 of `search.select`).
    scores = [o.flight_score for o in off_nominal(start) if o.term.effect.name == "inertia"]
    scores += [c.score for c in earlier if c.candidates[0].probe is not None]
    score, remaining = max(scores, default=None), MAX_CAUSES - len(earlier)
    while remaining:
        n = effort.later_nulls if steps else effort.nulls
        nulls = f"against {n} null simulations" if fit.is_corrected else "every candidate"
        clock.start(f"screen {len(steps) + 1}", f"Screening {nulls} …")
        step = screening_step(setup, fit, n)
        clock.start(f"fits {len(steps) + 1}", "Fitting what may be the cause …")
        step, diverged = step.chosen(setup, score), list[str]()
        wider = fit
        while step.choice is not None:
            wider = fit_with_cause(setup, fit, step.choice)
            if wider.is_corrected or not fit.is_corrected or setup.touches_stops:
                break
            # Flights simulated with this cause diverge.
            diverged.append(step.choice.term.name)
            step = step.next_choice(diverged, score)
        steps.append(step)
        if step.choice is None:
            break
        choice = step.choice
        clock.progress(f"Candidate: {choice.term.name}.")
        fit = wider
        if not choice.term.effect.of_base:  # a part of the body's equations is no defect
            remaining -= 1
            if choice.candidates[0].probe is not None:  # a grid trial has no probe
                score = choice.score if score is None else max(score, choice.score)
    return with_rivals_that_remain(steps), fit
