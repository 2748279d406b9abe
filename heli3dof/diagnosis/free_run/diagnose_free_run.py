"""Diagnose logs by a multi-step fit and backward elimination, if their likelihood is not valid.

The likelihood of a fit to such logs is invalid because of sampling jitter or unmodelled fast motion
(`identification.greybox.noise_check`). Their controller is unknown.

1. Two models are fitted to predictions of up to 3 s. The first one, the base simulation, consists
   of the equations of motion without any effect. The full model also contains the effects that are
   usual on real rigs. `free_run.candidates` adds further effects to the full model if they reduce
   the cost of the fit significantly. A term is an effect on one axis in the full model.
2. `free_run.elimination` tests each term on held-out blocks: do the predictions get worse without
   it? `free_run.cause_selection` then selects the causes among the terms.
3. `free_run.free_run_gain` compares the predictions of the base simulation and of the full model on
   held-out recordings. Without such recordings, it uses cross-validation. In the same way it
   compares the full model with and without each cause.
4. The full model is adopted if it predicts better. Otherwise the result is the base simulation.
5. `free_run.unexplained` reports what the adopted model does not explain.

A fit requires all three angles. So steps 1 to 4 omit recordings in which an angle is missing. Step
5 uses them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.base_parameters import base_parameters, off_nominal
from heli3dof.diagnosis.conclusion.confounded_parameters import with_thrust_gain_ties
from heli3dof.diagnosis.conclusion.doubtful_findings import marked_like
from heli3dof.diagnosis.conclusion.verdict import conclude
from heli3dof.diagnosis.free_run.candidates import with_further_effects
from heli3dof.diagnosis.free_run.cause_selection import (
    MeanTrimFit,
    confidence,
    kept_terms,
    not_identifiable,
    open_terms,
    select_causes,
    sizes,
)
from heli3dof.diagnosis.free_run.elimination import (
    Elimination,
    TermResult,
    eliminate,
    with_confounded_terms,
    without_elimination,
    without_term,
)
from heli3dof.diagnosis.free_run.free_run_gain import (
    FreeRun,
    cross_validated,
    free_run_errors,
    free_run_gain,
    predicts_better,
)
from heli3dof.diagnosis.free_run.refits import folds_of, refit
from heli3dof.diagnosis.free_run.residual_torques import residual_torques
from heli3dof.diagnosis.free_run.unexplained import explanation_sentences, unexplained_effects
from heli3dof.diagnosis.result import Diagnosis, Dropped, Finding, Fitted
from heli3dof.diagnosis.search.select import Choice
from heli3dof.diagnosis.unmodelled.unmodelled_torque import split_off_slow_noise
from heli3dof.diagnosis.validation.gain import Gain
from heli3dof.diagnosis.validation.prediction import HORIZONS_S, mean_square
from heli3dof.diagnosis.validation.simulation_error import SimulationError
from heli3dof.identification.closed_loop_fit.base_fit import BASES
from heli3dof.identification.greybox.freeflight import (
    fit_freeflight,
    flights_to_fit,
    model_of,
)
from heli3dof.identification.greybox.multistep import MultiStepFit as Fit
from heli3dof.identification.greybox.noise_check import likelihood_obstacle
from heli3dof.integrity import Fault
from heli3dof.model.effects import terms
from heli3dof.model.greybox.model import GreyBoxModel, nominal
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording
from heli3dof.stage_clock import Progress

METHOD = "The likelihood is not reliable: {} So the full model was fitted to 3 s predictions. "
WHY = METHOD + (
    "A term is a cause if left-out blocks need it and its size is significant; other terms keep "
    "their prior. There is no noise floor."
)
WHY_QUICK = METHOD + (
    "Quick mode leaves out no blocks, so only sizes and their intervals decide which terms are "
    "causes. There is no noise floor."
)
FITTING = "Fitting the full physical model to multi-step predictions …"
PREDICTS_WORSE = (
    "The model fitted by likelihood predicts held-out data worse than the profile's numbers do. So "
    "the motion between samples is unlike the model's, for example because of vibration."
)


def can_be_fitted(recordings: Sequence[Recording]) -> bool:
    """Return whether any recording has all three angles and suffices to fit 3 s predictions."""
    return bool(flights_to_fit(_all_angles(recordings)))


def no_likelihood(recordings: Sequence[Recording]) -> str:
    """Return the reason why the recordings' likelihood cannot be used; empty text if it can.

    In two cases nothing is tested and the result is empty:

    - The controller of at least one recording is known.
    - Every recording lacks an angle: the alternative, a multi-step fit, requires all three.
    """
    whole = _all_angles(recordings)
    if not whole or any(r.profile.controller is not None for r in whole):
        return ""
    return likelihood_obstacle(whole)


def diagnose_without_likelihood(
    train: Sequence[Recording],
    held: Sequence[Recording],
    faults: tuple[Fault, ...],
    *,
    why: str,
    base: str,
    quick: bool,
    seed: int,
    progress: Progress,
) -> Diagnosis:
    """Return the diagnosis of recordings in which the integrity checks found no bad data.

    ``faults``: minor faults that these checks found. ``why``: reason why there is no likelihood.
    The other arguments are as in `diagnose.diagnose`. With the base "hover", the full rigid-body
    equations (`geometry`) may be found as a cause. ``quick`` omits cross-validation. The estimates
    alone then select the causes, which are marked as unconfirmed. Without held-out data, ``quick``
    measures the gain on the training data.
    """
    whole, partial = _all_angles(train), [r for r in (*train, *held) if len(r.axes) < len(AXES)]
    flights = [r for r, _ in flights_to_fit(whole)]
    held_out = _all_angles(held)
    progress(FITTING)
    full = fit_freeflight(whole, progress=lambda round_: progress(f"{FITTING} {round_}"))
    progress("Testing the other effects of the catalogue …")
    full = with_further_effects(full)
    result = without_elimination(full) if quick else eliminate(full, seed=seed, progress=progress)
    progress("Fitting the base simulation …")
    simpler = BASES[base]
    base_fit = fit_freeflight(whole, simpler)
    progress("Measuring the gain …")
    model = model_of(result.fit, whole, "extended")
    base_model = model_of(base_fit, whole, "base")
    profile_model = nominal(whole[0].profile, simpler)
    tested = held_out or whole
    if held_out or quick:
        on = "holdout" if held_out else "the recordings themselves"
        as_profile, before, after = (
            FreeRun.of(m, tested) for m in (profile_model, base_model, model)
        )
    else:
        on = "blocks left out of the fit"
        base_halves = folds_of(base_fit)
        before, after = (_on_blocks(fits, whole) for fits in (base_halves, result.halves))
        as_profile = cross_validated([profile_model] * len(base_halves), whole)
    over_3_s = {"before": before.window_rmse_deg(), "after": after.window_rmse_deg()}
    causes, only_kept = select_causes(result)
    causes = with_confounded_terms(result, causes, seed=seed, progress=progress)
    if base == "hover" and result.halves:  # the linear model cancels the geometry
        r = without_term(result.first, "", seed=seed, instead="base.hover")
        causes += [replace(r, term="geometry")] * r.increase.significant
        causes.sort(key=lambda r: -r.increase.value)
    progress("Refitting without each cause …")
    pairs = _without_each(result, causes, whole, held_out)
    findings = tuple(_finding(result, r, free_run_gain(*pairs[r.term], on, seed)) for r in causes)
    is_adopted = predicts_better(before, after)
    if is_adopted:
        adopted, dropped = result.fit, tuple[Dropped, ...]()
        off = with_thrust_gain_ties(off_nominal(MeanTrimFit(adopted)))
        of_base = {o.term.name for o in off}
        findings = tuple(f for f in findings if f.term.name not in of_base)
        open_ = open_terms(result, causes, only_kept)
    else:
        adopted, model, after = base_fit, base_model, before
        dropped = tuple(Dropped(f.term.name, f.gain) for f in findings)
        findings, off, open_ = (), (), None
    fitted = Fitted(
        None, None, model, free_run_gain(before, after, on, seed), None, None,
        _profile_error(nominal(tested[0].profile, simpler), tested),
        refit=free_run_gain(as_profile, before, on, seed),
        calibration=base_parameters(MeanTrimFit(adopted)), open=open_,
    )  # fmt: skip
    if quick:
        findings = tuple(marked_like(f) for f in findings)
    residual, slow_noise = split_off_slow_noise(residual_torques(adopted))
    about = {
        "method": "multi-step predictions of the full physical model, backward elimination",
        "why": (WHY_QUICK if quick else WHY).format(why),
        "gain_measured_on": on,
        "adopted": is_adopted,
        **({"causes_untested": True} if quick else {}),
        "not_fitted": [r.name for r in partial],
        "over_3_s": over_3_s,
        "without": {name: less.window_rmse_deg() for name, (less, _) in pairs.items()},
        "kept_within_what_is_known": kept_terms(result, only_kept),
        "explains": explanation_sentences(adopted, flights, {f.term.name for f in findings}),
        "still_hidden": unexplained_effects(adopted, flights, partial),
        "seed": seed,
    }  # fmt: skip
    without_verdict = Diagnosis(
        tuple(r.name for r in train), tuple(r.name for r in held), "", faults, fitted, findings,
        off, dropped, residual_torques=residual, slow_noise=slow_noise, about=about,
        not_identifiable=tuple(not_identifiable(result.fit, causes)),
    )  # fmt: skip
    return conclude(without_verdict, AXES)


def _without_each(
    result: Elimination, causes: Sequence[TermResult], whole: Sequence[Recording],
    held: Sequence[Recording],
) -> dict[str, tuple[FreeRun, FreeRun]]:  # fmt: skip
    """Return for each cause the prediction errors of two models: (without the cause, with it).

    The model without the cause is a refit. Both models predict the recordings ``held``. If ``held``
    is empty, they predict the test blocks of the cross-validation. If there was no cross-validation
    either, they predict the recordings ``whole``, to which they were fitted.
    """

    if held or not result.halves:
        removal = {"geometry": ("", "base.hover")}
        full = _predicted(result.fit, whole, held)

        def one(i: int) -> tuple[FreeRun, FreeRun]:
            name = causes[i].term
            less = refit(result.first.fit, *removal.get(name, (name,)))
            return _predicted(less, whole, held), full

    else:

        def one(i: int) -> tuple[FreeRun, FreeRun]:
            name = causes[i].term
            fits = causes[i].fits or [(refit(fit, name), fit) for fit in result.last.folds]
            without, with_term = zip(*fits, strict=True)
            return _on_blocks(without, whole), _on_blocks(with_term, whole)

    return dict(zip([r.term for r in causes], parallel_map(one, len(causes)), strict=True))


def _predicted(fit: Fit, whole: Sequence[Recording], held: Sequence[Recording]) -> FreeRun:
    return FreeRun.of(model_of(fit, whole, ""), held or whole)


def _on_blocks(fits: Sequence[Fit], whole: Sequence[Recording]) -> FreeRun:
    """Return the prediction errors on each fold's test blocks; ``fits``: one for each fold."""
    return cross_validated([model_of(f, whole, "") for f in fits], whole)


def _all_angles(recordings: Sequence[Recording]) -> list[Recording]:
    return [r for r in recordings if len(r.axes) == len(AXES)]


def _finding(result: Elimination, r: TermResult, gained: Gain) -> Finding:
    fit, w = result.fit, r.increase
    (term,) = terms([r.term])
    values = {n: (float(x["value"]), float(x["std"])) for n, x in sizes(fit, r.term).items()}
    score = (w.value / w.std) ** 2 if w.std > 0 else 0.0
    choice = Choice(term, score, confidence(result, r), r.tied_with, ())
    return Finding(choice, values, gained, fit.noise)


def _profile_error(model: GreyBoxModel, recordings: Sequence[Recording]) -> SimulationError:
    """Return the errors of free-run predictions by ``model``, without a noise floor.

    ``model``: the base simulation (usually the rigid body without effects) with the profile's
    parameter values.
    """
    e = np.concatenate([free_run_errors(model, r, HORIZONS_S) for r in recordings])
    rmse = np.degrees(np.sqrt(mean_square(e)))
    return SimulationError(HORIZONS_S, rmse, np.full_like(rmse, np.nan), "", ())
