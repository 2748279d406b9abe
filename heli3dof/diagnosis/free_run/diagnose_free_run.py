"""The diagnosis of a log whose loop is unknown and which bears no likelihood, either for its clock
lies or for its motion one step ahead is no noise (`identification.greybox.noise_check`).

So nothing here rests on a likelihood: models are compared by free flights from re-estimated states
(`free_run.free_run_gain`) on the hold-out recordings, or on blocks left out where none is
given. What a single cause gains is measured there too, everything else refitted. An
extension that does not pay is not adopted, and the model is the base. The base is the rigid body
(or the hover model) refitted in the same way. There is no noise floor. The extended model is the
full one; which of its terms are causes, `free_run.naming` says, and what is still
hidden `free_run.unexplained`. Recordings in which not all three angles were read are not
fitted, for what the others did then is unknown, but held beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.conclusion.encoder_scales import undetectable_scales
from heli3dof.diagnosis.estimate.base_fit import BASES
from heli3dof.diagnosis.estimate.base_parameters import BaseParameter
from heli3dof.diagnosis.free_run.base_off import merged, off_profile
from heli3dof.diagnosis.free_run.elimination import (
    Elimination,
    Removal,
    Trial,
    eliminate,
    known_beforehand,
    swapped,
    tied,
    without_elimination,
)
from heli3dof.diagnosis.free_run.explanations import explains
from heli3dof.diagnosis.free_run.free_run_gain import FreeRun, fly, gain, left_out, pays
from heli3dof.diagnosis.free_run.naming import certainty, left_open, named, sizes, unseen, within
from heli3dof.diagnosis.free_run.recordings_agree import unsure
from heli3dof.diagnosis.free_run.refits import folds_of, refit
from heli3dof.diagnosis.free_run.unexplained import unexplained_effects
from heli3dof.diagnosis.free_run.weak_form import residual_torques
from heli3dof.diagnosis.integrity import Fault
from heli3dof.diagnosis.result import (
    Diagnosis,
    Dropped,
    Finding,
    Fitted,
    in_order,
    tied_in,
    verdict_of,
)
from heli3dof.diagnosis.selection.select import Choice
from heli3dof.diagnosis.validation.gain import Gain
from heli3dof.diagnosis.validation.prediction import HORIZONS_S
from heli3dof.diagnosis.validation.simulation_error import SimulationError
from heli3dof.identification.greybox.freeflight import (
    LEAST_STARTS,
    fit_freeflight,
    flight_of,
    model_of,
)
from heli3dof.identification.greybox.multistep import MultiStepFit as Fit
from heli3dof.identification.greybox.noise_check import likelihood_obstacle
from heli3dof.model.effects import terms
from heli3dof.model.greybox.model import nominal
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

METHOD = (
    "The controller is unknown, so null simulations are not possible, and the likelihood is not "
    "reliable: {} The full physical model was therefore fitted to 3 s predictions. "
)
WHY = METHOD + (
    "A term is a cause if left-out blocks need it and its size is significant; other terms keep "
    "their prior. Sizes are in units of the profile's K_f; there is no noise floor."
)
QUICK = METHOD + (
    "Quick mode leaves out no blocks, so causes rest on their sizes alone. Sizes are in units of "
    "the profile's K_f; there is no noise floor."
)
FITTING = "Fitting the full physical model to multi-step predictions …"
EACH = "Refitting without each cause …"
BLOCKS = "blocks left out of the fit"
Says = Callable[[str], None]


def no_likelihood(recordings: Sequence[Recording]) -> str:
    """Why these logs have to be diagnosed this way; empty where they need not."""
    whole = _whole(recordings)
    if not whole or any(r.profile.controller is not None for r in whole):
        return ""
    return likelihood_obstacle(whole)


def diagnose_real(
    train: Sequence[Recording],
    held: Sequence[Recording],
    faults: tuple[Fault, ...],
    *,
    why: str,
    base: str = "rigid",
    quick: bool = False,
    seed: int = 0,
    says: Says = lambda sentence: None,
) -> Diagnosis:
    """As `heli3dof.diagnosis.diagnose.diagnose`, of recordings whose integrity was checked.

    ``why`` is what `no_likelihood` said, ``base`` as there: with "hover" the rigid body is one more
    cause, needed or not as the others are, and taken whole. ``quick`` leaves no blocks out: names
    rest on their size alone and are "…-like", and the gain is that on what was fitted.
    """
    whole, runs = _whole(train), _rest([*train, *held])
    flights = [r for r in whole if len(flight_of(r).starts) >= LEAST_STARTS]
    kept_back = _whole(held)
    seen, on = (kept_back, "holdout") if kept_back else (whole, "the recordings themselves")
    says(FITTING)
    full = fit_freeflight(whole, say=lambda round_: says(f"{FITTING} {round_}"))
    found = (
        without_elimination(full) if quick else eliminate(full.problem, full, seed=seed, says=says)
    )
    says("Fitting the base simulation …")
    simpler = BASES[base]
    least = fit_freeflight(whole, simpler)
    says("Measuring the gain …")
    model = model_of(found.fit, whole, "extended")
    simple = model_of(least, whole, "base")
    after, before = FreeRun.of(model, seen), FreeRun.of(simple, seen)
    against = on
    if not kept_back and not quick:
        against = BLOCKS
        after = left_out([model_of(f, whole, "") for f in found.halves], whole)
        folds = folds_of(least)
        before = left_out([model_of(f, whole, "") for f, _ in folds], whole)
    causes, only_kept = named(found)
    causes = tied(found, causes, seed=seed, says=says)
    if base == "hover" and not quick:
        r = swapped(found, "base.hover", "geometry", seed=seed)
        causes += [r] * r.worse.kept
        causes.sort(key=lambda r: -r.worse.value)
    says(EACH)
    alone = _without(found, causes, whole, kept_back)
    findings = tuple(_finding(found, r, gain(*alone[r.term], against, seed)) for r in causes)
    poor = not pays(before, after)
    adopted = least if poor else found.fit
    dropped = tuple(Dropped(f.choice.term.name, f.gain) for f in findings) if poor else ()
    as_profile = FreeRun.of(nominal(whole[0].profile, simpler), seen)
    unfitted = gain(as_profile, FreeRun.of(simple, seen), on, seed)
    fitted = Fitted(
        None, None, simple if poor else model,
        gain(before, before if poor else after, against, seed), None, None,
        _wrong(seen, simpler), dict.fromkeys(AXES), unfitted,
        _calibrated(adopted),
        None if poor else left_open(found, model, causes, only_kept),
    )  # fmt: skip
    findings = () if poor else findings
    tolerance = whole[0].profile.tolerance
    off = () if poor else off_profile(found.begun, found.halves, tolerance)
    findings, off = merged(findings, off)
    if quick:
        findings = tuple(unsure(f) for f in findings)
    left = residual_torques(adopted)
    about = {
        "method": "multi-step predictions of the full physical model, backward elimination",
        "why": (QUICK if quick else WHY).format(why),
        "gain_measured_on": against,
        "adopted": not poor,
        "not_fitted": [r.name for r in runs],
        "over_3_s": {"before": before.over_deg(), "after": after.over_deg()},
        "without": {name: less.over_deg() for name, (less, _) in alone.items()},
        "by_recording": {
            name: dict(zip([r.name for r in flights], values.tolist(), strict=True))
            for name, values in found.fit.by_recording.items()
        },
        "known_beforehand": sorted(known_beforehand(found.fit.problem)),
        "kept_within_what_is_known": within(found, only_kept),
        "explains": explains(adopted, flights, {f.choice.term.name for f in findings}),
        "still_hidden": unexplained_effects(adopted, flights, runs),
        "seed": seed,
    }  # fmt: skip
    each = in_order((), findings, off)
    rest_rad = float(whole[0].profile.encoder.rest_rad[0])
    dark = undetectable_scales(tied_in(each), AXES, rest_rad=rest_rad, tolerance=tolerance)
    return Diagnosis(
        tuple(r.name for r in train), tuple(r.name for r in held),
        verdict_of(each, left, unfitted, unsure=quick), faults, fitted,
        findings, off, dropped, left, (),
        (*unseen(found.fit, causes), *dark), about,
    )  # fmt: skip


def _without(
    found: Elimination, causes: Sequence[Removal], whole: Sequence[Recording],
    held: Sequence[Recording],
) -> dict[str, tuple[FreeRun, FreeRun]]:  # fmt: skip
    """By term: everything but that cause, refitted, and everything, flown along what was not seen:
    recordings held out, or blocks left out (by the folds' own fits)."""

    swap = {"geometry": ("", "base.hover")}
    more = None if found.last is not None and not held else _flown(found.fit, whole, held)

    def one(i: int) -> tuple[FreeRun, FreeRun]:
        r = causes[i]
        if more is not None:
            return _flown(refit(found.begun, *swap.get(r.term, (r.term,))), whole, held), more
        assert found.last is not None
        at = r.trial or Trial(r.worse)
        beside = at.beside or tuple(fit for fit, _ in found.last.folds)
        less = at.fits or [refit(f, r.term) for f in beside]
        a, b = (left_out([model_of(f, whole, "") for f in fits], whole) for fits in (less, beside))
        return a, b

    return dict(zip([r.term for r in causes], parallel_map(one, len(causes)), strict=True))


def _flown(fit: Fit, whole: Sequence[Recording], held: Sequence[Recording]) -> FreeRun:
    return FreeRun.of(model_of(fit, whole, ""), held or whole)


def _whole(recordings: Sequence[Recording]) -> list[Recording]:
    return [r for r in recordings if len(r.axes) == len(AXES)]


def _rest(recordings: Sequence[Recording]) -> list[Recording]:
    return [r for r in recordings if len(r.axes) < len(AXES)]


def _finding(found: Elimination, r: Removal, won: Gain) -> Finding:
    fit, w = found.fit, r.worse
    (term,) = terms([r.term])
    values = {n: (float(x["value"]), float(x["std"])) for n, x in sizes(fit, r.term).items()}
    score = (w.value / w.std) ** 2 if w.std > 0 else 0.0
    choice = Choice(term, score, score, certainty(found, r), r.tied_with, ())
    return Finding(choice, values, won, fit.noise)


def _wrong(recordings: Sequence[Recording], simpler: tuple[str, ...] = ()) -> SimulationError:
    """The simulation as the profile has it."""
    model = nominal(recordings[0].profile, simpler)
    e = []
    for r in recordings:
        e.append(fly(model, r, np.array([max(1, round(h / r.dt)) for h in HORIZONS_S])))
    rmse = np.degrees(np.sqrt(np.nanmean(np.concatenate(e) ** 2, axis=0)))
    return SimulationError(
        tuple(HORIZONS_S), rmse, np.full_like(rmse, np.nan), "nothing: unknown", ()
    )


def _calibrated(fit: Fit) -> tuple[BaseParameter, ...]:
    """T_g and the inertias, in units of the profile's K_f."""
    return tuple(
        BaseParameter(f.name, f.start, float(v), float(s), f.unit)
        for f, v, s in zip(fit.structure.free[:4], fit.values, fit.std, strict=False)
    )
