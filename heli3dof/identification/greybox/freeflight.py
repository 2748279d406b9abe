"""Fit physical parameters by the method ``freeflight``: by free-run predictions of up to 3 s.

The method suits real rigs with sampling jitter (`heli3dof.recording.logs.sampling_jitter`) or with
unmodelled fast motion (`heli3dof.identification.greybox.noise_check`). The method ``greybox``
switches to this method if it detects jitter or such motion, unless the user named the effects
(``--terms``). `heli3dof.identification.greybox.multistep` defines the cost function.

`REAL_TERMS` are the effects that models of real rigs needed. Thrust effects are a power law of
rotor speed, a limit on spin-up, and inflow. Torque effects are, among others, dry friction, the
propellers' angular momentum, flapping, and the yaw coupling of a body that hangs below its axis.
Two effects have a different value in each recording. One is the offset of the pitch encoder,
because each recording zeroes the encoder at the angle at which the body hangs. The other is the
trim torque (``mass.imbalance``), because weights change, and thrust falls as the motors warm up.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heli3dof.errors import RecordingError
from heli3dof.identification.fit_result import FitResult, Parameter, Request
from heli3dof.identification.greybox.linear_uncertainty import fit_result
from heli3dof.identification.greybox.method import moving_terms
from heli3dof.identification.greybox.multistep import WINDOW_S, MultiStep, MultiStepFit, search
from heli3dof.identification.greybox.weak_form import weak_start
from heli3dof.identification.preprocessing import Prepared, moving_axes_only
from heli3dof.identification.row_selection import rows_in_flight, runs_of, unusable
from heli3dof.model.effects import terms
from heli3dof.model.estimation.filter_data import (
    GAP,
    RowRange,
    data_of,
    hold_last,
    starts_on_table,
)
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.greybox.prediction import Flight, table_of
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.recording import Recording
from heli3dof.stage_clock import Progress

REAL_TERMS = (
    "stiffness.pendulum.roll",
    "stiffness.pendulum.pitch",
    "friction.viscous.pitch",
    "friction.viscous.yaw",
    "motor.lag",
    "bias.torque.pitch",
    "motor.rotor_curve",
    "motor.spin_up",
    "aero.inflow",
    "aero.gyroscopic",
    "aero.flapping",
    "inertia.product",
    "friction.coulomb.roll",
    "friction.coulomb.pitch",
    "friction.coulomb.yaw",
    "encoder.offset.pitch",
    "mass.imbalance",
)
OFFSET = "encoder.offset.pitch.angle_deg"
WEIGHT = "mass.imbalance.torque_Nm"
VARYING = {OFFSET: 3.0, WEIGHT: 0.1}
"""Parameter with a value per recording → its standard deviation between recordings: encoder offset
(°), trim torque (N·m)"""
PRIORS: dict[str, tuple[float, float]] = {
    "motor.rotor_curve.exponent": (2.0, 0.2),
    "motor.lag.time_constant_s": (0.1, 0.05),
    "motor.spin_up.slowness_s_per_V": (0.015, 0.015),
    "stiffness.pendulum.roll.torque_Nm": (1.0, 2.0),
    "stiffness.pendulum.pitch.torque_Nm": (0.0, 0.2),
    "friction.viscous.roll.damping_Nms_per_rad": (0.0, 0.05),
    "friction.viscous.pitch.damping_Nms_per_rad": (0.0, 0.05),
    "friction.viscous.yaw.damping_Nms_per_rad": (0.0, 0.2),
    "friction.coulomb.roll.torque_Nm": (0.0, 0.05),
    "friction.coulomb.pitch.torque_Nm": (0.0, 0.01),
    "friction.coulomb.yaw.torque_Nm": (0.0, 0.05),
    "aero.flapping.moment_Nms_per_rad": (0.0, 0.15),
    "inertia.product.product_kgm2": (0.0, 0.1),
    "aero.gyroscopic.momentum_Nms_per_V": (0.0, 0.005),
    "aero.inflow.loss_s_per_m": (0.3, 0.3),
    "aero.inflow.exponent": (1.0, 0.05),
    "bias.torque.pitch.torque_Nm": (0.0, 0.02),
    OFFSET: (0.0, 8.0),
    WEIGHT: (0.0, 0.1),
}
"""Parameter → prior mean and standard deviation, from identified rigs and propellers. Without
priors, the values of confounded effects would be arbitrary: in flights about one trim, pitch
damping and flapping act alike until yaw moves."""
POSITIVE = ("friction.", "aero.flapping", "stiffness.pendulum")
"""Prefixes of the parameters that must not be negative (damping, restoring stiffness)"""
APART_S = 0.2
"""s: time between the starts of successive prediction windows"""
LEAST_WINDOWS = 20
LEAST_STARTS = 2
"""Recordings with fewer prediction windows than this are left out."""
METHOD = "freeflight"
INSTEAD = (
    f"Fitted to free-run predictions of up to 3 s instead (method {METHOD}); "
    "method='greybox' with terms='NAME,…' forces the likelihood."
)


def fit(prepared: Prepared, request: Request) -> FitResult:
    """Return physical parameters, fitted to multi-step predictions of the training runs.

    A warning names the recordings that are not fitted, because they lack an angle or are too short.
    """
    sources = sorted({r.source for r in prepared.train})
    whole = [prepared.recordings[i] for i in sources]
    several = [
        moving_axes_only(_cut(r, prepared.train, i)) for r, i in zip(whole, sources, strict=True)
    ]
    found = fit_freeflight(several, moving_terms(request.terms or REAL_TERMS, whole))
    fitted = [r for r, _ in flights_to_fit(several)]
    used = [r for r, part in zip(whole, several, strict=True) if any(part is f for f in fitted)]
    model = model_of(found, used, request.name)
    return fit_result(
        found,
        model,
        prepared.dt,
        parameters=parameters(found),
        warnings=(*_not_fitted(used, [*whole, *request.partial]), *warnings(found)),
        notes=notes(found),
    )


def _not_fitted(used: Sequence[Recording], given: Sequence[Recording]) -> tuple[str, ...]:
    """Return a warning that names the recordings in ``given`` that are not in ``used``, or ()."""
    fitted = {id(r) for r in used}
    rest = [r.name for r in given if id(r) not in fitted]
    if not rest:
        return ()
    return (
        f"The fit used {', '.join(r.name for r in used)}, but not {', '.join(rest)}: an angle was "
        "not measured, or the flight is too short.",
    )


def fit_freeflight(
    recordings: Sequence[Recording],
    names: Sequence[str] = REAL_TERMS,
    *,
    progress: Progress | None = None,
) -> MultiStepFit:
    """Return a multi-step fit of the effects ``names`` to ``recordings`` of one rig.

    The recordings need all angles. ``progress`` receives a line of text per iteration. The fit uses
    time windows of 3 s in which the rig flies: it is not on its table, at a mechanical stop, or in
    take-off. Raises RecordingError if there are fewer than `LEAST_WINDOWS` windows.
    """
    problem = problem_of(recordings, names)
    return search(problem, weak_start(problem, progress=progress), progress=progress)


def flights_to_fit(recordings: Sequence[Recording]) -> list[tuple[Recording, Flight]]:
    """Return the recordings that are long enough for a fit, each with its `Flight`.

    Each has at least `LEAST_STARTS` prediction windows. The result is empty if these recordings
    have fewer than `LEAST_WINDOWS` windows in total.
    """
    parts = ((r, flight_of(r)) for r in recordings)
    flights = [(r, f) for r, f in parts if len(f.starts) >= LEAST_STARTS]
    return flights if sum(len(f.starts) for _, f in flights) >= LEAST_WINDOWS else []


def problem_of(recordings: Sequence[Recording], names: Sequence[str] = REAL_TERMS) -> MultiStep:
    """Return the least-squares problem of a fit to ``recordings`` with the effects ``names``.

    It contains the recordings that `flights_to_fit` returns. Raises RecordingError if none remain.
    """
    structure = Structure(recordings[0].profile, terms(names))
    flights = flights_to_fit(recordings)
    if not flights:
        raise RecordingError(
            f"There are fewer than {LEAST_WINDOWS} windows of {WINDOW_S:.0f} s in flight to fit.",
            cause="the recordings are short, or spend their time on the table or at a stop.",
            fix="heli3dof info on the recordings, or method='greybox' with terms",
        )
    there = {k: v for k, v in VARYING.items() if k in structure.names}
    priors = {k: v for k, v in PRIORS.items() if k in structure.names}
    return MultiStep(
        structure,
        tuple(f for _, f in flights),
        tuple(data_of([r], _airborne(r)) for r, _ in flights),
        varying=there,
        spread={k: v for k, (_, v) in priors.items()},
        centre={k: v for k, (v, _) in priors.items()},
        least={k: 0.0 for k in structure.names if k.startswith(POSITIVE)},
    )


def flight_of(recording: Recording) -> Flight:
    """Return the recording as a `Flight`, with the start rows of the prediction windows to fit.

    A window is used only if the model applies to each of its rows (`free_rows`).
    """
    r = recording
    n, every = round(WINDOW_S / r.dt), max(1, round(APART_S / r.dt))
    bad = ~free_rows(r)
    count = np.concatenate([[0], np.cumsum(bad)])
    k = np.arange(0, max(len(r) - n, 0), every)
    h = np.append(np.diff(r.t), r.dt)
    measured = np.asarray(np.isfinite(r.angle).any(axis=0))
    return Flight(
        r.elapsed_s, h, hold_last(r.voltage), r.angle, measured,
        table_of(r)[0], k[count[k + n] == count[k]], starts_on_table(r),
    )  # fmt: skip


def free_rows(recording: Recording) -> np.ndarray:
    """Return (N,) bool: True for the rows to which the rigid-body model can be fitted.

    They are the rows in flight (`rows_in_flight`) without NaN, and not directly after a gap.
    """
    gap = np.concatenate([[False], np.diff(recording.t) > GAP * recording.dt])
    return np.asarray(rows_in_flight(recording) & ~unusable(recording)["unread"] & ~gap)


def _airborne(recording: Recording) -> list[RowRange]:
    """Return the row ranges that the Kalman filter can use: off the table, without gaps or NaN."""
    ok = ~table_of(recording)[1] & ~unusable(recording)["unread"]
    return runs_of(ok, recording, 0, GAP * recording.dt, 3)


def _cut(recording: Recording, runs: Sequence[RowRange], source: int) -> Recording:
    """Return the recording up to the end of its last training run, without the held-out rows.

    ``runs``: the training runs of all recordings; ``source``: the index of this recording.
    """
    return recording.rows(slice(0, max(r.stop for r in runs if r.source == source)))


def model_of(found: MultiStepFit, recordings: Sequence[Recording], name: str) -> GreyBoxModel:
    """Return the fitted model called ``name``, with names and digests of its recordings.

    For each parameter in `VARYING`, the fit ``found`` has one value per recording. The model has
    the mean of these values.
    """
    return GreyBoxModel(
        name=name,
        profile=found.structure.profile,
        terms=tuple(t.name for t in found.structure.terms),
        values=found.values,
        noise=found.noise[:3],
        jitter_s=float(found.noise[3]),
        covariance=found.covariance,
        varying=dict(found.problem.varying),
        extra={
            "method": METHOD,
            "recordings": [{"name": r.name, "sha256": r.digest} for r in recordings],
            "converged": found.converged,
            "by_recording": {name: values.tolist() for name, values in found.by_recording.items()},
        },
    )


def parameters(found: MultiStepFit) -> dict[str, Parameter]:
    """Return the fitted parameters by name.

    Each `Parameter` contains the estimate, its unit, its standard deviation and the nominal value.
    It also contains a warning if the recordings do not identify the parameter, else ``""``.
    """
    out = {}
    estimates = zip(found.structure.free, found.values, found.std, found.mostly_prior, strict=True)
    for f, v, s, vague in estimates:
        verdict = f"{f.name} is not identifiable from these recordings: its value is the prior's."
        verdict = verdict if vague else ""
        nominal = f.start if f.term is None else f.null
        out[f.name] = Parameter(float(v), float(s), f.unit, np.nan, nominal, verdict)
    return out


def warnings(found: MultiStepFit) -> tuple[str, ...]:
    """Return warnings: a parameter is not identifiable, or the fit did not converge."""
    out = [p.verdict for p in parameters(found).values() if p.verdict]
    if not found.converged:
        out.append(f"The fit had not converged after {found.rounds} rounds: too little motion.")
    return tuple(out)


def notes(found: MultiStepFit) -> tuple[str, ...]:
    """Return a sentence per parameter that varies by recording, with each recording's value."""
    out = []
    for name, values in found.by_recording.items():
        each = ", ".join(f"{v:.3g}" for v in values)
        claim = "differs by recording" if len(values) > 1 else "may differ by recording, here"
        out.append(f"{name} {claim}: {each}. Predictions re-estimate it.")
    return tuple(out)
