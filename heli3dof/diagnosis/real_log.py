"""The diagnosis of a log whose loop is unknown and which bears no likelihood, either for its clock
lies or for its motion one step ahead is no noise (`identification.greybox.noise_check`).

So nothing here rests on a likelihood: models are compared by free flights from re-estimated states.
With e_k(h) the error of flight k after h s,

    RMSE_i(h) = √(mean_k e_k,i(h)²),      over 3 s: √(1/3 ∫₀³ RMSE_i(h)² dh)

on the hold-out recordings, or on blocks left out where none is given: each half of the blocks by
the model fitted to the other. What a single cause gains is then measured on the recordings
themselves (said there). An extension pays where Σ_i (RMSE_i,after/RMSE_i,before)² over 3 s is below
the number of axes; one that does not is not adopted, and the model is the base. The base is the
rigid body (or the hover model) refitted in the same way. There is no noise floor. The
extended model is the full one; which of its terms are causes, `heli3dof.diagnosis.real_named` says,
and what is still hidden `heli3dof.diagnosis.real_hidden`. Recordings in which not all three angles
were read are not fitted, for what the others did then is unknown, but held beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.ahead import HORIZONS_S
from heli3dof.diagnosis.backward import (
    CELL_S,
    Backward,
    Removal,
    backward,
    glance,
    known_beforehand,
    swapped,
    tied,
)
from heli3dof.diagnosis.calibration import Calibrated
from heli3dof.diagnosis.gain import DRAWS, HORIZON_S, LEVEL, Gain, Interval
from heli3dof.diagnosis.how_wrong import HowWrong
from heli3dof.diagnosis.integrity import Fault
from heli3dof.diagnosis.real_base import merged, off_profile
from heli3dof.diagnosis.real_doubts import unsure
from heli3dof.diagnosis.real_explains import explains
from heli3dof.diagnosis.real_hidden import still_hidden
from heli3dof.diagnosis.real_leftover import leftovers
from heli3dof.diagnosis.real_named import certainty, named, sizes, unseen, within
from heli3dof.diagnosis.refits import folds_of, halves, refit
from heli3dof.diagnosis.result import Diagnosis, Dropped, Finding, Fitted, in_order, verdict_of
from heli3dof.diagnosis.select import Choice
from heli3dof.diagnosis.steps import BASES
from heli3dof.diagnosis.workers import in_threads
from heli3dof.identification.greybox.freeflight import (
    LEAST_STARTS,
    fit_freeflight,
    flight_of,
    model_of,
)
from heli3dof.identification.greybox.multistep import Fitted as Fit
from heli3dof.identification.greybox.noise_check import why_freeflight
from heli3dof.model.effects import terms
from heli3dof.model.greybox import GreyBoxModel, nominal
from heli3dof.model.greybox_predict import filtered
from heli3dof.model.greybox_windows import errors
from heli3dof.recording.recording import Recording

OVER_S = 3.0
STEP_S = 0.25
FAR = 10 * np.pi
"""rad: no flight is further off than that."""
WHY = (
    "The loop is unknown, so no nulls can be flown, and no likelihood can be trusted: {} So the "
    "full physical model was fitted to free flights of 3 s. What blocks left out need, and "
    "whose size is sure, is named; the rest is kept within what is known of such rigs. Sizes are "
    "in units of the profile's K_f; there is no noise floor."
)
QUICK = (
    "The loop is unknown, so no nulls can be flown, and no likelihood can be trusted: {} So the "
    "full physical model was fitted to free flights of 3 s. Quickly: no blocks were left out, so "
    "every name is one by its size alone. Sizes are in units of the profile's K_f; there is no "
    "noise floor."
)
FITTING = "Fitting the full physical model to free flights …"
EACH = "Each cause once more without it …"
BLOCKS = "blocks left out of the fit"
Says = Callable[[str], None]


def no_likelihood(recordings: Sequence[Recording]) -> str:
    """Why these logs have to be diagnosed this way; empty where they need not."""
    whole = _whole(recordings)
    if not whole or any(r.profile.controller is not None for r in whole):
        return ""
    return why_freeflight(whole)


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
    seen, on = _whole(held), "holdout"
    if not seen:
        seen, on = whole, "the recordings themselves"
    says(FITTING)
    full = fit_freeflight(whole, say=lambda round_: says(f"{FITTING} {round_}"))
    found = glance(full) if quick else backward(full.problem, full, seed=seed, says=says)
    says("Fitting the base simulation in the same way …")
    simpler = BASES[base]
    least = fit_freeflight(whole, simpler)
    says("Measuring the gain …")
    model = model_of(found.fit, whole, "extended")
    simple = model_of(least, whole, "base")
    after, before = Flown.of(model, seen), Flown.of(simple, seen)
    own, against = after, on  # what single causes are measured by
    if not held and not quick:
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
    alone = _without(found, causes, whole, seen, says)
    findings = tuple(_finding(found, r, gain(alone[r.term], own, on, seed)) for r in causes)
    poor = not pays(before, after)
    adopted = least if poor else found.fit
    dropped = tuple(Dropped(f.choice.term.name, f.gain) for f in findings) if poor else ()
    fitted = Fitted(
        None, None, simple if poor else model,
        gain(before, before if poor else after, against, seed), None, None,
        _wrong(seen, simpler), dict.fromkeys(AXES), _calibrated(adopted),
    )  # fmt: skip
    findings = () if poor else findings
    tolerance = whole[0].profile.tolerance
    off = () if poor else off_profile(found.begun, found.halves, tolerance)
    findings, off = merged(findings, off)
    if quick:
        findings = tuple(unsure(f) for f in findings)
    left = leftovers(adopted)
    about = {
        "method": "free flights of the full physical model, and backwards from it",
        "why": (QUICK if quick else WHY).format(why),
        "gain_measured_on": against,
        "adopted": not poor,
        "not_fitted": [r.name for r in runs],
        "over_3_s": {"before": before.over_deg(), "after": after.over_deg()},
        "without": {name: flown.over_deg() for name, flown in alone.items()},
        "by_recording": {
            name: dict(zip([r.name for r in flights], values.tolist(), strict=True))
            for name, values in found.fit.by_recording.items()
        },
        "known_beforehand": sorted(known_beforehand(found.fit.problem)),
        "kept_within_what_is_known": within(found, only_kept),
        "explains": explains(adopted, flights, {f.choice.term.name for f in findings}),
        "still_hidden": still_hidden(adopted, flights, runs),
        "seed": seed,
    }  # fmt: skip
    each = in_order((), findings, off)
    return Diagnosis(
        tuple(r.name for r in train), tuple(r.name for r in held),
        verdict_of(each, left, unsure=quick), faults, fitted,
        findings, off, dropped, left,
        tuple(unseen(found.fit, causes)), about,
    )  # fmt: skip


def _without(
    found: Backward, causes: Sequence[Removal], whole: Sequence[Recording], seen: list[Recording],
    says: Says,
) -> dict[str, Flown]:  # fmt: skip
    """By term: everything but that cause, refitted, flown along what is seen."""
    swap = {"geometry": ("", "base.hover")}

    def one(i: int) -> Flown:
        fit = refit(found.begun, *swap.get(causes[i].term, (causes[i].term,)))
        return Flown.of(model_of(fit, whole, ""), seen)

    says(EACH)
    flown = in_threads(one, len(causes), lambda n: says(f"{EACH} {n} of {len(causes)}"))
    return dict(zip([r.term for r in causes], flown, strict=True))


def _whole(recordings: Sequence[Recording]) -> list[Recording]:
    return [r for r in recordings if len(r.axes) == len(AXES)]


def _rest(recordings: Sequence[Recording]) -> list[Recording]:
    return [r for r in recordings if len(r.axes) < len(AXES)]


class Flown:
    """Free flights of a model along recordings: errors, and the cell that each belongs to."""

    def __init__(self, e: np.ndarray, cell: np.ndarray) -> None:
        self.e = e
        """(S, M, 3) rad, every `STEP_S` to `OVER_S`"""
        self.cell = cell
        """(S,)"""

    @classmethod
    def of(cls, model: GreyBoxModel, recordings: Sequence[Recording]) -> Flown:
        every, cells, last = [], [], 0
        for r in recordings:
            flight = flight_of(r)
            ahead = np.array([round(h / r.dt) for h in np.arange(1, 13) * STEP_S])
            every.append(fly(model, r, ahead))
            cell = np.floor(flight.t[flight.starts] / CELL_S).astype(int) + last
            cells.append(cell)
            last = int(cell.max(initial=last)) + 1
        return cls(np.concatenate(every), np.concatenate(cells))

    def only(self, rows: np.ndarray) -> Flown:
        """(S,) bool"""
        return Flown(self.e[rows], self.cell[rows])

    def rmse_deg(self, horizon_s: float, rows: np.ndarray | slice = slice(None)) -> np.ndarray:
        """(3,) degrees at that horizon"""
        e = self.e[rows, round(horizon_s / STEP_S) - 1]
        return np.asarray(np.degrees(np.sqrt(np.nanmean(e**2, axis=0))))

    def over_deg(self) -> dict[str, float]:
        """By axis over `OVER_S`."""
        squares = np.vstack([np.zeros((1, 3)), np.nanmean(self.e**2, axis=0)])
        mean = np.trapezoid(squares, dx=STEP_S, axis=0) / OVER_S
        return dict(zip(AXES, np.degrees(np.sqrt(mean)).tolist(), strict=True))


def left_out(models: Sequence[GreyBoxModel], recordings: Sequence[Recording]) -> Flown:
    """Each fold's test windows, flown by the model that was fitted to the other folds."""
    parts = []
    for fold, model in enumerate(models):
        flights = [flight_of(r) for r in recordings]
        test = [np.isin(f.starts, halves(f, fold)[1].starts) for f in flights]
        parts.append(Flown.of(model, recordings).only(np.concatenate(test)))
    return Flown(np.concatenate([p.e for p in parts]), np.concatenate([p.cell for p in parts]))


def pays(before: Flown, after: Flown) -> bool:
    """Whether the extension predicts better over 3 s, every axis counting alike."""
    b, a = (np.array(list(x.over_deg().values())) for x in (before, after))
    return bool(np.nansum((a / b) ** 2) < np.isfinite(a / b).sum())


def fly(model: GreyBoxModel, recording: Recording, ahead: np.ndarray) -> np.ndarray:
    """(S, M, 3) rad: errors ``ahead`` (M,) rows after each start of `flight_of`."""
    flight = flight_of(recording)
    states = filtered(model, recording)[3]
    with np.errstate(all="ignore"):
        e = errors(model.structure, model.values, flight, states, ahead, tuple(model.varying))
    e = np.clip(np.nan_to_num(e, nan=FAR, posinf=FAR, neginf=-FAR), -FAR, FAR)
    e[..., ~flight.free] = np.nan
    return np.asarray(e)


def gain(before: Flown, after: Flown, on: str, seed: int) -> Gain:
    """On the same flights, 1 s ahead; cells are drawn for the intervals."""
    two = [dict(zip(AXES, x.rmse_deg(HORIZON_S).tolist(), strict=True)) for x in (before, after)]
    rng = np.random.default_rng([seed, 5])
    k = round(HORIZON_S / STEP_S) - 1
    names = np.unique(before.cell)
    there = np.isfinite(before.e[:, k])
    count = np.array([there[before.cell == c].sum(axis=0) for c in names])
    sums = [
        np.array([np.nansum(x.e[before.cell == c, k] ** 2, axis=0) for c in names])
        for x in (before, after)
    ]
    drawn = rng.integers(0, len(names), (DRAWS, len(names)))
    n = np.maximum(count[drawn].sum(axis=1), 1)
    falls = np.subtract(*[np.degrees(np.sqrt(s[drawn].sum(axis=1) / n)) for s in sums])
    tail = 50 * (1 - LEVEL)
    low, high = np.percentile(falls, [tail, 100 - tail], axis=0)
    won = {
        a: Interval(two[0][a] - two[1][a], float(low[i]), float(high[i]))
        for i, a in enumerate(AXES)
    }
    return Gain(on, two[0], two[1], won, None, None)


def _finding(found: Backward, r: Removal, won: Gain) -> Finding:
    fit, w = found.fit, r.worse
    (term,) = terms([r.term])
    values = {n: (float(x["value"]), float(x["std"])) for n, x in sizes(fit, r.term).items()}
    score = (w.value / w.std) ** 2 if w.std > 0 else 0.0
    choice = Choice(term, score, score, certainty(found, r), r.tied_with, ())
    return Finding(choice, values, won, fit.noise)


def _wrong(recordings: Sequence[Recording], simpler: tuple[str, ...] = ()) -> HowWrong:
    """The simulation as the profile has it."""
    model = nominal(recordings[0].profile, simpler)
    e = []
    for r in recordings:
        e.append(fly(model, r, np.array([max(1, round(h / r.dt)) for h in HORIZONS_S])))
    rmse = np.degrees(np.sqrt(np.nanmean(np.concatenate(e) ** 2, axis=0)))
    return HowWrong(tuple(HORIZONS_S), rmse, np.full_like(rmse, np.nan), "nothing: unknown", ())


def _calibrated(fit: Fit) -> tuple[Calibrated, ...]:
    """T_g and the inertias, in units of the profile's K_f."""
    return tuple(
        Calibrated(f.name, f.start, float(v), float(s), f.unit)
        for f, v, s in zip(fit.structure.free[:4], fit.values, fit.std, strict=False)
    )
