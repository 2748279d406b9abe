"""`diagnose`: recordings in, a `Diagnosis` out. The order of things is the order of this file.

1. The base: the profile's rigid body, its T_g and inertias refitted.
2. The screen of every candidate, against simulated nulls of the recordings' own fit.
3. Causes one by one by full fits (`heli3dof.diagnosis.select`); after each, nulls and screen anew.
4. What it gains on held-out recordings, against the base refitted.

Work in progress, and no verb yet: integrity checks, the unknown (`leftover`), intervals of the gain
and dropping what does not pay are still to come, and so is a table of hits and false alarms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from heli3dof.diagnosis.catalogue import Probe, Reach, candidates, probes
from heli3dof.diagnosis.gain import log_likelihood, noise_floor_deg, rmse_deg
from heli3dof.diagnosis.nulls import DISTRUSTED, formula_nulls, loop_is_known, simulated_nulls
from heli3dof.diagnosis.screen import Screen, screen
from heli3dof.diagnosis.select import MOST, Choice, choose, without
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.method import fit_greybox, model_of
from heli3dof.model.greybox import GreyBoxModel, nominal
from heli3dof.recording.recording import Recording

FLIGHTS, QUICK_FLIGHTS, FURTHER_FLIGHTS = 50, 12, 16
Says = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Finding:
    """A cause: its term, the fit in which it was taken, and what it gains on the test flights."""

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
    base: Estimate
    final: Estimate
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
    says("Fitting the base simulation …")
    base = fit_greybox(train, ())
    known = loop_is_known(train)
    flights = QUICK_FLIGHTS if quick else FLIGHTS
    found = base
    choices: list[Choice] = []
    unseen: tuple[str, ...] = ()
    method = ""
    while len(choices) < MOST:
        looked = _probes(found, train)
        says(f"Screening {len(looked)} probes, {flights} simulated nulls …")
        seen = screen(found, looked)
        nulls = (
            simulated_nulls(found, train, looked, flights=flights, seed=seed)
            if known
            else formula_nulls(found, looked)
        )
        if not choices:
            unseen, method = _unseen(seen), nulls.method
        choice = choose(found, seen, nulls, choices[0].score if choices else None)
        if choice is None:
            break
        says(f"Found {choice.term.name}.")
        choices.append(choice)
        found = choice.fit
        flights = min(flights, FURTHER_FLIGHTS)
    test = held or train
    found, choices = _eliminated(found, choices)
    model, plain = model_of(found, train, "extended"), model_of(base, train, "base")
    before, after = rmse_deg(plain, test), rmse_deg(model, test)
    findings = []
    for c in choices:
        less = model_of(without(found, c.term), train, "less")
        findings.append(
            Finding(
                c, _values(found, c), rmse_deg(less, test), after,
                log_likelihood(model, test) - log_likelihood(less, test),
            )
        )  # fmt: skip
    off = _off_nominal(found)
    return Diagnosis(
        tuple(r.name for r in train), tuple(r.name for r in held),
        _verdict(findings, off), base, found, tuple(findings), off,
        rmse_deg(nominal(train[0].profile), test), before, after,
        noise_floor_deg(model, test, seed), unseen, model,
        {"nulls": method, "null_flights": FLIGHTS if not quick else QUICK_FLIGHTS, "seed": seed,
         "gain_measured_on": "holdout" if held else "the recordings themselves"},
    )  # fmt: skip


def _probes(found: Estimate, recordings: Sequence[Recording]) -> list[Probe]:
    reach = Reach(
        float(np.nanmax(np.abs(found.problem.data.V))), max(r.duration for r in recordings)
    )
    taken = [t.name for t in found.structure.terms]
    axes = [a for a in ("roll", "pitch", "yaw") if any(a in r.axes for r in recordings)]
    return [p for t in candidates(taken, axes) for p in probes(t, reach)]


def _unseen(seen: Screen) -> tuple[str, ...]:
    """Candidates of which the recordings say nothing: z is zero for want of information."""
    names = dict.fromkeys(p.name for p in seen.probes)
    dark = [
        n for n in names if all(seen.z[i] == 0 for i, p in enumerate(seen.probes) if p.name == n)
    ]
    return tuple(dark)


def _eliminated(found: Estimate, choices: list[Choice]) -> tuple[Estimate, list[Choice]]:
    """Backward: a cause that later ones made superfluous goes."""
    kept = list(choices)
    rows = np.log(max(found.problem.data.rows, 2))
    for c in choices[:-1] if len(choices) > 1 else []:
        less = without(found, c.term)
        price = len(c.term.effect.parameters) * rows
        if less.optimum.converged and 2 * (found.optimum.loglik - less.optimum.loglik) < price:
            found, kept = less, [k for k in kept if k.term.name != c.term.name]
    return found, kept


def _values(found: Estimate, choice: Choice) -> dict[str, tuple[float, float]]:
    return {
        f.name.removeprefix(choice.term.name + "."): (float(v), float(s))
        for f, v, s in zip(found.free, found.values, found.std, strict=True)
        if f.term == choice.term.name
    }


def _off_nominal(found: Estimate) -> tuple[str, ...]:
    """Base parameters off by more than the profile's tolerance, surely (two standard deviations).

    None where the fit is not to be trusted (see `nulls`).
    All in units of K_f: where they are all off together by one factor, K_f is what is off.
    """
    if found.inflation > DISTRUSTED:
        return ()
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
