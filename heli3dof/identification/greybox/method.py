"""The method ``greybox`` of `heli3dof.identification.identify`, and `fit_greybox` for other terms.

`DEFAULT_TERMS` are what every rig has: pendulum stiffness, viscous friction, rotor lag, and the two
constant torques that no rig is without (its trims). Others are switched on by name.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from heli3dof.errors import UsageError, did_you_mean
from heli3dof.identification.fit_result import Found, Innovations, Parameter, Request
from heli3dof.identification.greybox.estimate import Estimate, estimate
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import NOISE_START
from heli3dof.identification.greybox.multistep import Fitted
from heli3dof.identification.greybox.structure_test import as_written
from heli3dof.identification.preprocessing import Prepared, Run
from heli3dof.identification.row_selection import unusable
from heli3dof.identification.transfer_function import TransferFunctions
from heli3dof.identification.uncertainty import Pole
from heli3dof.model.compiled import announced
from heli3dof.model.discretisation import numerators
from heli3dof.model.effects import terms
from heli3dof.model.estimation.filter_data import LOST, Stretch, data_of
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.logs.sampling_jitter import motion_jitter
from heli3dof.recording.recording import Recording

DEFAULT_TERMS = (
    "stiffness.pendulum.roll",
    "stiffness.pendulum.pitch",
    "friction.viscous.roll",
    "friction.viscous.pitch",
    "friction.viscous.yaw",
    "motor.lag",
    "bias.torque.pitch",
    "bias.torque.yaw",
)
TEST_INTERVAL_S = 0.04
"""Residual tests look at errors of predictions this far ahead, end to end: at every sample an
encoder's rounding is most of an error."""
LEAST_RUN_S = 0.5
LYING = 0.2
"""Of the period: below it the likelihood, whose filter knows jitter, does better."""


def fit(prepared: Prepared, request: Request) -> Found:
    """The grey box on the prepared training runs, and on what recordings of fewer angles hold."""
    if request.terms is None and not request.partial and (why := no_likelihood(prepared)):
        from heli3dof.identification.greybox import freeflight

        return freeflight.handed_over(freeflight.fit(prepared, request), why)
    first = prepared.recordings[0]
    chosen = DEFAULT_TERMS if request.terms is None else request.terms
    several = [*prepared.recordings, *request.partial]
    runs: list[Stretch] = [Stretch(r.source, r.start, r.stop) for r in prepared.train]
    for i, recording in enumerate(request.partial, start=len(prepared.recordings)):
        runs += usable_runs(recording, i)
    problem = Likelihood(data_of(several, runs), Structure(first.profile, terms(chosen)))
    compile_first(problem)
    found = estimate(problem)
    if request.terms is None:
        found = as_written(found)
    sources = sorted({r.source for r in runs})
    model = model_of(found, [several[i] for i in sources], request.name)
    linear = model.linear(prepared.dt)
    poles_, transfer, response = linear_figures(found, prepared.dt)
    return Found(
        model=model,
        order=linear.order,
        interval_s=prepared.dt,
        innovations=lambda p, runs: innovations(model, p, runs),
        poles=poles_,
        transfer=transfer,
        parameters=parameters(found),
        warnings=warnings(found),
        response=response,
        test_interval_s=TEST_INTERVAL_S,
        correlation=found.correlation,
    )


def no_likelihood(prepared: Prepared) -> str:
    """Why the training recordings bear no likelihood (`noise_check`), empty where they do.

    Where the loop is known, only the clock is asked.
    """
    from heli3dof.identification.greybox.noise_check import CLOCK, why_freeflight

    sources = [prepared.recordings[i] for i in sorted({r.source for r in prepared.train})]
    if any(r.profile.controller is not None for r in sources):
        return CLOCK if all(clock_lies(r) for r in sources) else ""
    return why_freeflight(sources)


def clock_lies(recording: Recording) -> bool:
    """True where its motion shows jitter by more than `LYING` of the period."""
    r = recording
    m = motion_jitter(r.t, r.angle, r.profile.encoder.rad_per_count)
    return m.found and m.sigma_s > LYING * r.dt


def compile_first(problem: Likelihood) -> None:
    """Compile what the estimator runs, saying so where that takes a while; once per process."""
    from heli3dof.model.estimation.ekf_quantised import filter_blocks

    if filter_blocks.signatures:
        return
    with announced("Compiling the grey-box estimator; this happens once and takes a while …"):
        theta = problem.prior_mean
        problem.tangents(theta, problem.run(theta, np.array(NOISE_START)), np.arange(1))


def chosen_terms(words: str) -> tuple[str, ...]:
    """Terms from ``+name,-name`` (changes of `DEFAULT_TERMS`) or ``name,name`` (these alone).

    Raises UsageError for an unknown name (naming the nearest), or for one to leave out that is
    not there.
    """
    names = [w.strip() for w in words.split(",") if w.strip()]
    chosen = [] if names and names[0][0] not in "+-" else list(DEFAULT_TERMS)
    for word in names:
        name = word.lstrip("+-")
        if word.startswith("-"):
            if name not in chosen:
                raise UsageError(
                    f"--terms: there is no {name!r} to leave out.",
                    cause=f"a typing error; {did_you_mean(name, chosen)}",
                    fix=f"the terms by default: {', '.join(DEFAULT_TERMS)}",
                )
            chosen.remove(name)
        elif name not in chosen:
            chosen.append(name)
    terms(chosen)
    return tuple(chosen)


def fit_greybox(
    recordings: Recording | Sequence[Recording],
    names: Sequence[str] = DEFAULT_TERMS,
    *,
    read_every_s: float = 0.0,
    start: Mapping[str, float] | None = None,
) -> Estimate:
    """Fit a rig with these terms to recordings; `model_of` makes the model of it.

    A recording may hold one angle only (the others count as held still), its loop may be unknown;
    all must be of one rig. Rows on the table, at a stop, unread or with the motors off are left
    out. ``start`` gives other starting values by parameter name; ``read_every_s`` see `data_of`.
    Raises RecordingError where nothing is left, UsageError for an unknown term.
    """
    several = [recordings] if isinstance(recordings, Recording) else list(recordings)
    runs = [run for i, r in enumerate(several) for run in usable_runs(r, i)]
    structure = Structure(several[0].profile, terms(names)) if several else None
    data = data_of(several, runs, read_every_s=read_every_s)
    assert structure is not None
    problem = Likelihood(data, structure)
    theta = None if start is None else problem.coordinates(structure.values_of(start))
    return estimate(problem, start=theta)


def usable_runs(recording: Recording, source: int) -> list[Stretch]:
    """Stretches of usable rows, at least `LEAST_RUN_S` long.

    A gap ends one where more than `LOST` periods are missing; a late sample is none.
    """
    bad = np.logical_or.reduce(list(unusable(recording).values()))
    breaks = np.flatnonzero(np.diff(recording.t) > LOST * recording.dt) + 1
    edges = np.unique(
        np.concatenate([[0, len(bad)], breaks, np.flatnonzero(np.diff(bad.astype(int))) + 1])
    )
    least = LEAST_RUN_S / recording.dt
    return [
        Stretch(source, int(a), int(b))
        for a, b in itertools.pairwise(edges)
        if not bad[a] and b - a >= least
    ]


def model_of(found: Estimate, recordings: Sequence[Recording], name: str) -> GreyBoxModel:
    """The fitted model, ready to fly, predict and save, with what made it."""
    extra: dict[str, Any] = {
        "method": "greybox",
        "recordings": [{"name": r.name, "sha256": r.digest} for r in recordings],
        "heli3dof": _version(),
        "log_likelihood": found.optimum.loglik,
        "converged": found.optimum.converged,
        "inflation": found.inflation,
        "cramer_rao_bound": found.bound.tolist(),
        "verdicts": [v.sentence for v in found.verdicts if v.sentence],
    }
    return GreyBoxModel(
        name=name,
        profile=found.structure.profile,
        terms=tuple(t.name for t in found.structure.terms),
        values=found.values,
        noise=found.optimum.noise[:3],
        jitter_s=float(found.optimum.noise[3]),
        covariance=found.covariance,
        extra=extra,
    )


def parameters(found: Estimate) -> dict[str, Parameter]:
    """By name, with standard deviation, bound, nominal value and verdict."""
    return {
        f.name: Parameter(
            float(v), float(s), f.unit, float(b), f.start if f.term is None else f.null, w.sentence
        )
        for f, v, s, b, w in zip(
            found.free, found.values, found.std, found.bound, found.verdicts, strict=True
        )
    }


def warnings(found: Estimate) -> tuple[str, ...]:
    """What to be told of besides the numbers."""
    said = [v.sentence for v in found.verdicts if v.sentence]
    said += [t.effect.summary for t in found.structure.formal]
    o = found.optimum
    if not o.converged:
        said.append(
            f"The fit had not settled after {o.rounds} rounds: the recordings hold something that "
            "no term explains, or too little. Try others: heli3dof identify … --terms +NAME"
        )
    said += [
        f"{f.name} went to its bound, {v:.4g} {f.unit}: another effect is taking its place."
        for f, v, stuck in zip(found.free, found.values, o.at_bound, strict=True)
        if stuck
    ]
    if found.inflation > 2:
        said.append(
            f"The scores scatter {found.inflation:.1f} times as much as the noise model allows: "
            "the recordings hold motion that no term explains. Standard deviations account for it, "
            "biases they cannot. Try other terms: heli3dof identify … --terms +NAME"
        )
    return tuple(said)


def innovations(model: GreyBoxModel, prepared: Prepared, runs: Sequence[Run]) -> Innovations:
    """Errors of predictions `TEST_INTERVAL_S` ahead, end to end, and the mean voltages of each."""
    q = max(1, round(TEST_INTERVAL_S / prepared.dt))
    E, U = [], []
    for run in runs:
        part = prepared.recordings[run.source].rows(slice(run.start, run.stop))
        n = (len(part) - 1) // q
        if n < 2:
            continue
        rows = q * np.arange(1, n + 1)
        E.append((part.angle - model.predict(part, q * part.dt))[rows])
        U.append(part.voltage[: n * q].reshape(n, q, 2).mean(axis=1))
    return E, U


def linear_figures(
    found: Estimate | Fitted, dt: float
) -> tuple[
    tuple[Pole, ...],
    TransferFunctions,
    Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
]:
    """Poles, transfer functions and responses about hover, by differences along the parameters."""
    theta = found.theta
    sd = found.std / found.slopes
    cov = found.covariance / np.outer(found.slopes, found.slopes)

    def at(point: np.ndarray) -> Any:
        model = GreyBoxModel(
            "", found.structure.profile, tuple(t.name for t in found.structure.terms),
            found.values_at(point), np.zeros(3), np.full((len(point), len(point)), np.nan),
        )  # fmt: skip
        return model.linear(dt).continuous()

    here = at(theta)
    steps = 1e-2 * np.minimum(sd, 1.0)
    moved = [at(theta + np.eye(len(theta))[j] * e) for j, e in enumerate(steps)]
    p0 = np.linalg.eigvals(here.A)

    def nearest(A: np.ndarray) -> np.ndarray:
        p = list(np.linalg.eigvals(A))
        return np.array([p.pop(int(np.argmin(np.abs(np.array(p) - z)))) for z in p0])

    slope = np.array([(nearest(c.A) - p0) / e for c, e in zip(moved, steps, strict=True)]).T
    std = [
        (
            np.sqrt(max(float(s.real @ cov @ s.real), 0)),
            np.sqrt(max(float(s.imag @ cov @ s.imag), 0)),
        )
        for s in slope
    ]
    poles = sorted(
        (Pole(complex(z), float(a), float(b)) for z, (a, b) in zip(p0, std, strict=True)),
        key=lambda p: (-p.value.real, p.value.imag),
    )

    def coefficients(c: Any) -> np.ndarray:
        num, den = numerators(c)
        return np.concatenate([den[1:], num.ravel()])

    c0 = coefficients(here)
    T = np.array([(coefficients(c) - c0) / e for c, e in zip(moved, steps, strict=True)]).T
    num, den = numerators(here)

    def response(omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        def G(c: Any) -> np.ndarray:
            eye = np.eye(len(c.A))
            return np.array([c.C @ np.linalg.solve(1j * w * eye - c.A, c.B) + c.D for w in omega])

        G0 = G(here)
        dG = np.array([(G(c) - G0) / e for c, e in zip(moved, steps, strict=True)])
        var = np.einsum("iabc,ij,jabc->abc", dG.real, cov, dG.real)
        var += np.einsum("iabc,ij,jabc->abc", dG.imag, cov, dG.imag)
        return G0, np.sqrt(np.maximum(var, 0))

    return tuple(poles), TransferFunctions(num, den, T @ cov @ T.T), response


def _version() -> str:
    return version("heli3dof")
