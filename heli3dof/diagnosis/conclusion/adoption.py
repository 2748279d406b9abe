"""What the causes gain on data that they have not seen, and which of them do not pay.

`validation.gain` compares two fits; here they are made: everything found, everything but
one, nothing (the base), each refitted. A cause whose gain does not pay is taken out, the one that
pays least first, and the rest are measured again.

The first cause stood up to the nulls, and a short flight's few cells bound no gain: it pays where
held-out data are likelier with it. Later ones are only as good as the first one's formula; they
pay where the gain's interval lies above zero, or as a first one does where their score is beyond
what a wrong formula leaves (`select.WEAK`). What acts for moments only (a dead zone, a limit) has
its gain in so few cells that their bootstrap bounds nothing: it pays too where held-out data are
likelier by `MUCH` and the error in degrees of an axis is surely less. One that moves the rig mostly
as another does, and is told as "…-like" only (`selection.select`), cannot gain much beside
it: it is taken as a first one is, since without it the other one's size would surely be wrong.

Where one does not pay, those that it was tied with are asked in its place before it is dropped
(`selection.alternatives`): the margin by which it was taken may have been chance.

A cause has stood up to nulls of white noise. Where the recordings' own noise is slower
(`estimate.coloured_noise`) it has to stand up to that as well. And what an encoder's zero within
one count does as well is no cause: every rig has that.

Two causes that were tied when the first of them was taken, and are both here in the end, are tied
no more: each has paid beside the other, so neither stands in the other's place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import replace
from typing import Any

from heli3dof.axes import AXES
from heli3dof.diagnosis.estimate.base_parameters import in_SI
from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit, model_at
from heli3dof.diagnosis.estimate.thrust_scale import thrust_scale
from heli3dof.diagnosis.result import (
    COLOURED,
    DOES_NOT_PAY,
    WITHIN_A_COUNT,
    Dropped,
    Finding,
    Fitted,
)
from heli3dof.diagnosis.selection.select import WEAK, Choice, certainty
from heli3dof.diagnosis.selection.steps import without
from heli3dof.diagnosis.validation.cross_validation import held_out, uncalibrated
from heli3dof.diagnosis.validation.gain import Gain, HeldOut, gain, pays
from heli3dof.diagnosis.validation.simulation_error import simulation_error
from heli3dof.identification.greybox.method import model_of
from heli3dof.model.greybox.model import nominal
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

Instead = Callable[[CorrectedFit, Choice, Set[str]], Iterable[tuple[Choice, CorrectedFit]]]
"""Of a fit without a cause, that cause and all names asked so far: what else the cause may be, and
the fit with that."""
OFFSET, PLAY = "encoder.offset", "encoder.backlash"
LEAST = 3.0
"""Held-out log-likelihood that a first, a strong or a weak cause has to gain: odds of 20 to one."""
MUCH = 12.0
"""The same of a later one whose interval holds zero: under the smaller model exp Δℓ on data that
were not seen is 1 on average at most, so it exceeds e¹² once in that (Markov), whatever the cells.
"""


def adopted(
    found: CorrectedFit, choices: Sequence[Choice], holdout: Sequence[Recording], *, seed: int,
    instead: Instead | None = None,
) -> tuple[CorrectedFit, tuple[Finding, ...], tuple[Dropped, ...], HeldOut]:  # fmt: skip
    """The causes that pay, the fit that holds them alone, what was dropped, and how it does.

    ``instead`` says what a cause that does not pay may be replaced by; what pays stands then.
    """
    kept, dropped = list(choices), list[Dropped]()
    asked = {c.term.name for c in choices}
    while True:
        less = parallel_map(lambda i, f=found: without(f, kept[i].term), len(kept))  # type: ignore[misc]
        after, *afters = each_held_out((found, *less), holdout)
        gains = [gain(o, after, seed=seed) for o in afters]
        stands = [
            0.0 if within_a_count(found, c) else exceeds_coloured_noise(found, c) for c in kept
        ]
        poor = [i for i, g in enumerate(gains) if not pays_enough(kept[i], g, first=i == 0)]
        poor = [i for i, s in enumerate(stands) if s < 1] or poor
        if not poor:
            return found, _findings(found, kept, less, gains), tuple(dropped), after
        worst = min(poor, key=lambda i: (min(stands[i], 1.0), won(gains[i])))
        gone = kept[worst]
        if stands[worst] < 1:
            why = WITHIN_A_COUNT if within_a_count(found, gone) else COLOURED
            others: Iterable[tuple[Choice, CorrectedFit]] = ()
        else:
            why, others = DOES_NOT_PAY, instead(less[worst], gone, asked) if instead else ()
        for other, wider in others:
            asked.add(other.term.name)
            g = gain(held_out(less[worst], holdout), held_out(wider, holdout), seed=seed)
            if pays_enough(other, g, first=worst == 0):
                found, kept[worst] = wider, other
                break
        else:
            dropped.append(Dropped(gone.term.name, gains[worst], why, choice=gone))
            found = less[worst]
            del kept[worst]


def each_held_out(fits: Sequence[CorrectedFit], holdout: Sequence[Recording]) -> list[HeldOut]:
    """Every fit on what it has not seen."""
    return parallel_map(lambda i: held_out(fits[i], holdout), len(fits), what="fits")


def exceeds_coloured_noise(found: CorrectedFit, choice: Choice) -> float:
    """Z² over the nulls' threshold where the recordings' noise is as it is, not white.

    That of a cause which no probe sees, or which the base lacks and every rig has, is infinite.
    """
    if choice.threshold <= 0 or choice.term.effect.of_base:
        return math.inf
    j = _number_of(found, choice.term.name)
    if j is None:
        return math.inf
    rho = float(found.colour[j])
    return math.inf if rho <= 1 else choice.Z2 / rho / choice.threshold


def within_a_count(found: CorrectedFit, choice: Choice) -> bool:
    """Whether it is play of at most one count, or is (or is tied with) a zero off by no more.

    Where within a count the zero lies is nobody's doing: counts begin at power-up, and a card that
    rounds down reads half a count less than one that rounds. On pitch that is a torque on yaw. And
    play that an encoder cannot show by one count is none that it has shown. Its own size is that in
    ``found``, the last fit: without a cause that went it may be another than when it was taken.
    """
    for c in choice.contenders:
        axis, own = c.term.axis, c.term.name == choice.term.name
        if axis is None or not (
            c.term.effect.name == OFFSET or (own and c.term.effect.name == PLAY)
        ):
            continue
        if not own and c.term.name not in choice.tied_with:
            continue
        count_deg = 360.0 / abs(getattr(c.problem.structure.profile.encoder, axis))
        j = _number_of(found, c.term.name) if own else None
        size = c.problem.values(c.optimum.theta)[-1] if j is None else found.values[j]
        if abs(size) <= count_deg:
            return True
    return False


def _number_of(found: CorrectedFit, name: str) -> int | None:
    """Where a term's first number stands in a fit; None where the fit has no such term."""
    return next((j for j, f in enumerate(found.free) if f.term == name), None)


def pays_enough(choice: Choice, g: Gain, *, first: bool) -> bool:
    """Whether a cause is adopted for that gain."""
    strong = first or choice.weak or choice.score >= WEAK
    less = any(i is not None and i.low > 0 for i in g.rmse_deg.values())
    return pays(g) or (strong and won(g) > LEAST) or (less and won(g) > MUCH)


def fitted(
    base: CorrectedFit, found: CorrectedFit, extended: CorrectedFit, after: HeldOut,
    train: Sequence[Recording], holdout: Sequence[Recording], *, seed: int,
) -> Fitted:  # fmt: skip
    """The base simulation and the extended one, side by side."""
    model = model_of(extended, train, "extended")
    at = model_at(extended.problem, extended.optimum.theta, extended.optimum.noise)
    profiles = nominal(train[0].profile, tuple(t.name for t in base.structure.terms))
    # Its filter knows the base fit's noise, so that a rig with just these numbers meets the floor.
    profiles = replace(profiles, noise=base.optimum.noise[:3])

    def part(i: int) -> Any:
        if i == 0:
            return after if extended is base else held_out(base, holdout)
        if i == 1:
            return uncalibrated(base, holdout)
        return simulation_error(profiles, holdout or train, truth=at, seed=seed)

    before, as_is, wrong = parallel_map(part, 3)
    floor = {a: _number(wrong.at(1.0, a)[1]) for a in AXES}
    return Fitted(
        base, found, model, gain(before, after, seed=seed), before, after, wrong, floor,
        refit=gain(as_is, before, seed=seed),
    )  # fmt: skip


def _findings(
    found: CorrectedFit,
    choices: Sequence[Choice],
    less: Sequence[CorrectedFit],
    gains: Sequence[Gain],
) -> tuple[Finding, ...]:
    scale = thrust_scale(found)
    written = [t.name for t in found.structure.formal]
    choices = beside_each_other(choices, written)
    return tuple(
        Finding(
            replace(c, confidence=min(c.confidence, size_confidence(found, c.term.name))),
            forwards(in_SI(found, scale, c.term.name)), g, w.optimum.noise,
        )
        for c, w, g in zip(choices, less, gains, strict=True)
    )  # fmt: skip


def size_confidence(found: CorrectedFit, name: str) -> float:
    """Return the probability that a term's first parameter v has the sign found: Φ(|v − v_0|/σ).

    v_0 is its value in a rig without the effect. One for a term without such a value, as a limit.
    """
    from scipy.stats import norm

    j = _number_of(found, name)
    if j is None or found.free[j].log or not math.isfinite(found.free[j].null):
        return 1.0
    return float(norm.cdf(abs(float(found.values[j]) - found.free[j].null) / float(found.std[j])))


def beside_each_other(choices: Sequence[Choice], written: Sequence[str] = ()) -> list[Choice]:
    """The choices without ties among themselves, or with how the fit's equations are ``written``;
    the certainty is against what else there was.

    A weak one has not surely paid: what was tied with it still is.
    """
    named = {c.term.name for c in choices if not c.weak} | set(written)
    out = []
    for c in choices:
        tied = tuple(n for n in c.tied_with if n not in named)
        sure = c.confidence
        if len(tied) < len(c.tied_with):
            others = [x.score for x in c.contenders if x.term.name not in named]
            sure = max(sure, certainty([c.score, max([0.0, *others])]))
        out.append(replace(c, tied_with=tied, confidence=sure))
    return out


def won(g: Gain) -> float:
    """The log-likelihood's gain"""
    assert g.log_likelihood is not None
    return g.log_likelihood.value


def forwards(values: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    """A periodic torque with τ > 0 and a phase in (−π, π]: −τ sin is τ sin half a period later."""
    out = dict(values)
    if {"torque_Nm", "phase_rad"} <= out.keys():
        (torque, std), (phase, spread) = out["torque_Nm"], out["phase_rad"]
        turned = phase + (math.pi if torque < 0 else 0.0)
        out["torque_Nm"] = abs(torque), std
        out["phase_rad"] = math.pi - (math.pi - turned) % (2 * math.pi), spread
    return out


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
