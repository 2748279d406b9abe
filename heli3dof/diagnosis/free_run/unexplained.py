"""What a fitted rig does not explain of its recordings: told beside the causes, with numbers.

Take-off, of which nothing is fitted. From the last row on the table roll runs free to the end of
the climb, once with rotors at rest in the file's first row and once at the speed that its voltages
would keep: what they did before the file begins decides between. From `SPUN_UP_S` after lift-off
they have forgotten it. From there on the mean of p̈, by the weak form
(`heli3dof.identification.greybox.weak_form`), is held beside the mean of what the model says along
the measured path, with the deviation that the parameters' covariance gives it; it is told where
they are more than `SURELY` deviations apart.

A constant voltage V on both motors, read on roll alone: where the arm stands early and late
(`EARLY_S`, `LATE_S`) and where the model says it stands at once,

    L_a F(V) = (T_g + τ) cos r + k_r sin r = Γ(r),       F_late/F_early = Γ(r_late)/Γ(r_early)

Thrust that grows by that factor, at one voltage, would do the same; or as much more voltage as
the thrust curve asks for it. Whether one such number is what several runs show, is told too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from heli3dof.diagnosis.free_run.explanations import arm_torque, hover_voltage, settles_at
from heli3dof.identification.greybox.multistep import MultiStepFit
from heli3dof.identification.greybox.weak_form import DIFFERENCE, SPANS_S, log_of, residuals
from heli3dof.model.estimation.filter_data import climb_rows
from heli3dof.model.greybox.multistep import errors
from heli3dof.model.greybox.prediction import table_of
from heli3dof.model.physics.integrator import readings
from heli3dof.recording.recording import Recording

SPUN_UP_S = 0.35
SURELY = 2.0
LONGEST_S = 5.0
"""A climb that takes longer is none."""
EARLY_S = (8.0, 18.0)
"""s after the voltage came: the swing that its onset makes has its mean by then"""
LATE_S = 10.0
LEAST_S = 30.0
ON_TABLE_DEG = 2.0
CREPT_DEG = 1.0
OFF_DEG = 2.0
"""Less than that is not told."""
ONE_SIZE = 2.0
"""Growths that differ by more are not one and the same."""


def unexplained_effects(
    fit: MultiStepFit, flights: Sequence[Recording], runs: Sequence[Recording] = ()
) -> list[dict[str, Any]]:
    """JSON-able, each with its ``sentence``; ``flights`` are the fit's, ``runs`` are not."""
    out = [x for i, r in enumerate(flights) for x in take_off(fit, i, r)]
    out += [x for r in runs for x in creep(fit, r)]
    return out + list(together([c for r in runs if (c := crept(fit, r)) is not None]))


def take_off(fit: MultiStepFit, i: int, recording: Recording) -> Iterator[dict[str, Any]]:
    """How the climb of the fit's recording i goes, and how the model says it should."""
    p, flight = fit.problem, fit.problem.flights[i]
    off = np.flatnonzero(~table_of(recording)[1])
    if not flight.still or not len(off) or off[0] == 0:
        return
    k, roll = int(off[0]) - 1, flight.y[:, 0]
    n = climb_rows(roll[k + 1 :], flight.low, flight.dt)
    if not 2 * SPUN_UP_S < n * flight.dt < LONGEST_S:
        return
    values = p.values(fit.z, i)
    X = np.full((len(roll), 6), np.nan)
    X[k] = _at_rest(p.structure, values, flight.y[k])
    measured, model, std = _pitch(fit, i, k, n)
    if abs(measured - model) < SURELY * std:
        return
    rises = float(np.degrees(roll[k + n] - roll[k]))
    rest, speed = (
        rises - np.degrees(errors(p.structure, values, one, X, np.array([n]))[0, 0, 0])
        for still in (True, False)
        for one in (replace(flight, starts=np.array([k]), still=still),)
    )
    seconds = n * flight.dt
    yield {
        "what": "take_off", "recording": recording.name, "seconds": seconds,
        "roll_deg": {
            "measured": rises, "model_rotors_at_rest": rest, "model_rotors_at_speed": speed,
        },
        "pitch_acceleration_rad_per_s2": {
            "measured": measured, "model": model, "model_std": std,
        },
        "sentence": f"The take-off of {recording.name} was not fitted. In its {seconds:.1f} s roll "
        f"rises by {_deg(rises)}; the model predicts {_deg(rest)} with rotors initially at rest "
        f"and {_deg(speed)} with rotors at steady speed. From {SPUN_UP_S:g} s after lift-off, when "
        f"this no longer matters, pitch accelerates by {_number(measured)} rad/s² on average; the "
        f"thrusts that fit the flight give {_number(model)} ± {_number(std)}.",
    }  # fmt: skip


def _pitch(fit: MultiStepFit, i: int, k: int, n: int) -> tuple[float, float, float]:
    """Mean p̈ over the climb, rows k + spun up … k + n: measured, the model's, its deviation."""
    p = fit.problem
    flight = p.flights[i]
    first = k + round(SPUN_UP_S / flight.dt)
    climb = replace(flight, starts=np.array([first]))
    log = log_of(climb, max((k + n - first) * flight.dt, SPANS_S[0] + 2 * flight.dt))
    alone = replace(p, flights=(climb,), data=(p.data[i],), rows=(p.rows[i],))
    b = len(p.own)
    here = np.r_[: p.n, p.n + i * b : p.n + (i + 1) * b]
    measured = float(log.spans[0].integrals(log.y, np.zeros_like(log.y))[:, 1].mean())

    def model(z: np.ndarray) -> float:
        return measured - float(residuals(alone, [log], z)[0][:, 1].mean())

    z = fit.z[here]
    at = model(z)
    slope = np.array([model(z + d) - at for d in DIFFERENCE * np.eye(len(z))]) / DIFFERENCE
    C = np.linalg.inv(fit.tangents @ fit.tangents.T + p.prior)[np.ix_(here, here)]
    return measured, at, float(np.sqrt(slope @ C @ slope))


def _at_rest(structure: Any, values: np.ndarray, reading: np.ndarray) -> np.ndarray:
    """(6,) the state that reads so, at rest."""
    x = np.concatenate([reading, np.zeros(3)])
    hooks = structure.hooks
    s, par = structure.arrays(values)
    m, slope = np.empty(3), np.empty(3)
    readings(s, x, hooks.first, hooks.address, par, structure.memory, m, slope)
    x[:3] -= (m - x[:3]) / slope
    return np.asarray(x)


@dataclass(frozen=True)
class Crept:
    """Where the arm stands at one constant voltage, early and late, and where the model says."""

    recording: str
    voltage_V: float
    early_deg: float
    late_deg: float
    model_deg: float
    thrust_late_over_early: float
    as_if_V: float
    """By how much more voltage would give as much more thrust"""
    seconds: float

    @property
    def creeps(self) -> bool:
        return abs(self.late_deg - self.early_deg) > CREPT_DEG


def constant_voltage(recording: Recording) -> tuple[int, int] | None:
    """First and last row of the one voltage that both motors had throughout; None where not so."""
    V = recording.voltage
    on = np.flatnonzero((V > 0).all(axis=1))
    if not len(on) or np.ptp(V[on]) > 1e-9 or on[-1] - on[0] + 1 != len(on):
        return None
    return int(on[0]), int(on[-1])


def crept(fit: MultiStepFit, recording: Recording) -> Crept | None:
    """None where no constant voltage held the arm off the table long enough."""
    r, on = recording, constant_voltage(recording)
    if on is None:
        return None
    t, roll = r.t - r.t[on[0]], np.degrees(r.angle[:, 0])
    end = float(t[on[1]])
    if np.isnan(roll).any() or end < LEAST_S:
        return None
    early = float(roll[(t >= EARLY_S[0]) & (t < EARLY_S[1])].mean())
    late = float(roll[(t > end - LATE_S) & (t <= end)].mean())
    if early < np.degrees(table_of(r)[0]) + ON_TABLE_DEG:
        return None
    volts = float(r.voltage[on[0], 0])
    factor = arm_torque(fit, late) / arm_torque(fit, early)
    more = hover_voltage(fit, late) / hover_voltage(fit, early)
    return Crept(
        r.name, volts, early, late, settles_at(fit, volts), factor, volts * (more - 1), end
    )


def creep(fit: MultiStepFit, recording: Recording) -> Iterator[dict[str, Any]]:
    """Whether the arm keeps moving at a constant voltage, and where the model says it stands."""
    c = crept(fit, recording)
    if c is None or (not c.creeps and abs(c.model_deg - c.early_deg) < OFF_DEG):
        return
    sentence = (
        f"At {c.voltage_V:g} V on both motors ({c.recording}, not fitted) the arm is at "
        f"{_deg(c.early_deg)} after {EARLY_S[0]:.0f} to {EARLY_S[1]:.0f} s; the model predicts "
        f"{_deg(c.model_deg)}."
    )
    if c.creeps:
        sentence += (
            f" Then it creeps to {_deg(c.late_deg)} by {c.seconds:.0f} s, as if thrust at that "
            f"voltage grew by {100 * (c.thrust_late_over_early - 1):.0f} %. The model has no such "
            "slow dynamics. Warm motors, a bearing or an unrecorded tilt are possible; these runs "
            "do not separate them."
        )
    yield {"what": "creep", **asdict(c), "sentence": sentence}


def together(runs: Sequence[Crept]) -> Iterator[dict[str, Any]]:
    """Whether one growth of thrust, or one of voltage, is what all of the runs show."""
    if len({c.voltage_V for c in runs}) < 2 or not any(c.creeps for c in runs):
        return
    each = {
        "thrust": [c.thrust_late_over_early - 1 for c in runs],
        "voltage": [c.as_if_V for c in runs],
    }
    one = {k: min(v) > 0 and max(v) < ONE_SIZE * min(v) for k, v in each.items()}
    each_run = "; ".join(
        f"{c.voltage_V:g} V: {100 * (c.thrust_late_over_early - 1):.0f} % of thrust, or "
        f"{c.as_if_V:.2f} V".replace("-", "−")
        for c in runs
    )
    fits = [k for k, v in one.items() if v]
    yield {
        "what": "creep_together", "runs": [c.recording for c in runs], "one_size": one,
        "sentence": f"Equivalent growth during the creep, by run: {each_run}. "
        + (f"One growth of {' or of '.join(fits)} explains all of them."
           if fits else "No common growth of thrust or of voltage explains all of them."),
    }  # fmt: skip


def _deg(angle: float) -> str:
    return f"{_number(angle)}°"


def _number(value: float) -> str:
    return f"{value:.1f}".replace("-", "−")
