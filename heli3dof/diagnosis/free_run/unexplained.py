"""Report which properties of a rig the fitted model explains, and which it does not.

**Equilibrium.** Roll is the arm's rotation that lifts the body. In steady flight at the roll angle
r, with level pitch, both motors at voltage V give the thrust F (N, `motor.rotor_curve`). Its torque
balances the torque Γ(r) of the arm:

    F(V) = 2 K_f V_o (V/V_o)^n
    L_a F(V) = Γ(r) = (T_g + τ) cos r + k_r sin r

K_f (N/V) is the thrust gain, V_o (V) the operating voltage, n the exponent of the thrust curve and
L_a (m) the arm's length. T_g (N·m) is the trim torque (gravity torque of the level arm), τ (N·m)
the torque of `mass.imbalance`, and k_r (N·m) the pendulum torque. The hover voltage V_hover at a
roll angle is the equilibrium of the model with all its effects (`linearisation.hover_voltage`).

**Take-off, not explained.** The fit omits the take-off, because the rotors' initial speed is
unknown: it depends on earlier voltages. From `SPUN_UP_S` after lift-off on, this speed no longer
matters. From then to the end of the climb, the module computes two mean pitch accelerations
(rad/s²) in weak form: the measured one, and the one of the model at the measured angles and rates.
The take-off is reported if they differ by at least `SIGMAS_95` standard deviations. The parameters'
covariance gives this standard deviation. The report also compares the measured climb in roll with
two simulations: one starts with rotors at rest, the other with rotors at steady speed.

**Creep, not explained.** Creep is a slow change of roll while both motors have the same constant
voltage. The mean roll near the start of the recording (`EARLY_S`) is compared with the mean roll in
its last `LATE_S` seconds, and with the model's equilibrium. The thrust that creep implies grows by
the factor

    F_late/F_early = Γ(r_late)/Γ(r_early)

The equivalent voltage increase is the change of V that raises F(V) by this factor. Recordings at
different voltages may have a common cause of creep. So `compare_runs` tests two hypotheses: the
thrust grows by the same percentage in all of them, or as if the voltage rose by the same number of
volts.

**Explained properties.** `explanation_sentences` states three properties with measured numbers: the
mean pitch angle in steady flight, the change of the hover voltage with roll, and the dead zone of
one motor. The thrust of a motor at the voltage V, divided by its thrust at hover, is (V/V_hover)^n.
Rows are in steady flight if the mean roll rate over `STILL_S` is below `STILL_DEG_PER_S`.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from heli3dof.diagnosis.conclusion.doubtful_findings import constant_voltage
from heli3dof.diagnosis.constants import SIGMAS_95
from heli3dof.diagnosis.free_run.refits import with_recordings
from heli3dof.identification.greybox.freeflight import OFFSET, free_rows
from heli3dof.identification.greybox.multistep import MultiStepFit
from heli3dof.identification.greybox.weak_form import (
    DIFFERENCE,
    SPANS_S,
    residuals,
    smoothed_flight,
)
from heli3dof.model.estimation.filter_data import climb_rows
from heli3dof.model.greybox.linearisation import equilibrium_deg, hover_voltage
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.greybox.prediction import errors, table_of
from heli3dof.model.physics.integrator import readings
from heli3dof.recording.recording import Recording

STILL_S = 0.5
STILL_DEG_PER_S = 3.0
"""s, °/s: averaging time and largest mean roll rate of steady flight. Chosen; not derived."""
LOW_V = (2.0, 3.5)
"""V: two voltages in the dead zone of one motor, as users observe it"""
LEAST_HOVER = 2.0
"""Least ratio of hover voltage to the higher `LOW_V` at which a dead zone is reported. Chosen."""
PENDULUM = "stiffness.pendulum.roll.torque_Nm"
EXPONENT = "motor.rotor_curve.exponent"
SPUN_UP_S = 0.35
LONGEST_S = 5.0
"""Take-off: s after lift-off, s of the longest climb. Chosen."""
EARLY_S = (8.0, 18.0)
"""s after the voltage step: interval of the early mean, which averages the step's oscillation.
Chosen."""
LATE_S = 10.0
LEAST_S = 30.0
"""s: averaging time at the end of a run, and least duration of a run. Chosen."""
ON_TABLE_DEG = 2.0
LEAST_CREEP_DEG = 1.0
LEAST_ERROR_DEG = 2.0
"""°: least height above the table; least creep or model error that is reported. Chosen."""
LARGEST_RATIO = 2.0
"""Largest ratio of two growths of thrust, or of two slopes, that count as equal. Chosen."""


def unexplained_effects(
    fit: MultiStepFit, flights: Sequence[Recording], runs: Sequence[Recording] = ()
) -> list[dict[str, Any]]:
    """Return a list of JSON objects: motions that the fitted model does not explain.

    Such a motion is a take-off, or creep (a slow change of roll at constant voltage). Each object
    has a ``sentence``. ``flights``: the fitted recordings, examined for take-offs. ``runs``:
    recordings examined for creep. They are not fitted, because one of their three angles was not
    recorded.
    """
    measured = [c for r in runs if (c := measure_creep(fit, r)) is not None]
    out = [x for i, r in enumerate(flights) for x in take_off(fit, i, r)]
    return [*out, *(x for c in measured for x in creep(c)), *compare_runs(measured)]


def take_off(fit: MultiStepFit, i: int, recording: Recording) -> Iterator[dict[str, Any]]:
    """Yield a JSON object of recording i's take-off if the model does not explain it."""
    p, flight = fit.problem, fit.problem.flights[i]
    airborne = np.flatnonzero(~table_of(recording)[1])
    if not flight.still or not len(airborne) or airborne[0] == 0:
        return
    k, roll = int(airborne[0]) - 1, flight.y[:, 0]
    n = climb_rows(roll[k + 1 :], flight.low, flight.dt)
    if not 2 * SPUN_UP_S < n * flight.dt < LONGEST_S:
        return
    values = p.values(fit.z, i)
    X = np.full((len(roll), 6), np.nan)
    X[k] = _state_at_rest(p.structure, values, flight.y[k])
    measured, model, std = _pitch_acceleration(fit, i, k, n)
    if abs(measured - model) < SIGMAS_95 * std:
        return
    rises = float(np.degrees(roll[k + n] - roll[k]))
    at_rest, at_speed = (
        rises - np.degrees(errors(p.structure, values, one, X, np.array([n]))[0, 0, 0])
        for still in (True, False)
        for one in (replace(flight, starts=np.array([k]), still=still),)
    )
    seconds = n * flight.dt
    yield {
        "what": "take_off", "recording": recording.name, "seconds": seconds,
        "roll_deg": {
            "measured": rises, "model_rotors_at_rest": at_rest, "model_rotors_at_speed": at_speed,
        },
        "pitch_acceleration_rad_per_s2": {
            "measured": measured, "model": model, "model_std": std,
        },
        "sentence": f"The take-off of {recording.name} was not fitted. In its {seconds:.1f} s roll "
        f"rises by {_deg(rises)}; the model predicts {_deg(at_rest)} with rotors initially at rest "
        f"and {_deg(at_speed)} with rotors at steady speed. From {SPUN_UP_S:g} s after lift-off, "
        f"when this no longer matters, pitch accelerates by {_number(measured)} rad/s² on average; "
        f"the thrusts that fit the flight give {_number(model)} ± {_number(std)}.",
    }  # fmt: skip


def _pitch_acceleration(fit: MultiStepFit, i: int, k: int, n: int) -> tuple[float, float, float]:
    """Return the mean pitch acceleration in a take-off, in rad/s²: (measured, of the model, σ).

    σ is the standard deviation of the model's value. The mean is over the rows of recording i from
    `SPUN_UP_S` after row k to row k + n.
    """
    alone, at = with_recordings(fit.problem, [i])
    (flight,) = alone.flights
    first = k + round(SPUN_UP_S / flight.dt)
    climb = replace(flight, starts=np.array([first]))
    log = smoothed_flight(climb, max((k + n - first) * flight.dt, SPANS_S[0] + 2 * flight.dt))
    alone = replace(alone, flights=(climb,))
    measured = float(log.spans[0].integrals(log.y, np.zeros_like(log.y))[:, 1].mean())

    def error(z: np.ndarray) -> float:
        return float(residuals(alone, [log], z)[0][:, 1].mean())

    z = fit.z[at]
    e = error(z)
    slope = np.array([error(z + d) - e for d in DIFFERENCE * np.eye(len(z))]) / DIFFERENCE
    C = fit.scaled_covariance[np.ix_(at, at)]
    return measured, measured - e, float(np.sqrt(slope @ C @ slope))


def _state_at_rest(structure: Any, values: np.ndarray, reading: np.ndarray) -> np.ndarray:
    """Return the state (6,) at rest whose encoders read ``reading`` (3,) rad."""
    x = np.concatenate([reading, np.zeros(3)])
    s, *effects = structure.arguments(values)
    m, slope = np.empty(3), np.empty(3)
    readings(s, x, *effects, m, slope)
    x[:3] -= (m - x[:3]) / slope
    return np.asarray(x)


@dataclass(frozen=True)
class CreepRun:
    """Mean roll at constant voltage near a recording's start and end, and the model's equilibrium.

    The means are over the time interval `EARLY_S` and over the last `LATE_S` seconds.
    """

    recording: str
    voltage_V: float
    early_deg: float
    late_deg: float
    model_deg: float
    thrust_late_over_early: float
    as_if_V: float
    """V: voltage increase equivalent to the growth of thrust"""
    seconds: float

    @property
    def creeps(self) -> bool:
        return abs(self.late_deg - self.early_deg) > LEAST_CREEP_DEG


def measure_creep(fit: MultiStepFit, recording: Recording) -> CreepRun | None:
    """Return the creep (slow change of roll at constant voltage) in a recording.

    The result is None unless both motors have the same constant voltage for at least `LEAST_S`, and
    this voltage holds the arm above the table.
    """
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
    ratio = hover_voltage(fit, late) / hover_voltage(fit, early)
    model = equilibrium_deg(fit, volts)
    return CreepRun(r.name, volts, early, late, model, factor, volts * (ratio - 1), end)


def creep(c: CreepRun) -> Iterator[dict[str, Any]]:
    """Yield a JSON object if the model does not explain the roll angle at constant voltage.

    There are two such cases: the roll angle creeps (changes slowly), or it differs from the model's
    equilibrium by at least `LEAST_ERROR_DEG`.
    """
    if not c.creeps and abs(c.model_deg - c.early_deg) < LEAST_ERROR_DEG:
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


def compare_runs(runs: Sequence[CreepRun]) -> Iterator[dict[str, Any]]:
    """Yield a JSON object that states whether one change explains the creep of all recordings.

    Creep is a slow change of roll at constant motor voltages; ``runs`` contains the creep of each
    recording. Two changes are tested. In the first, thrust grows by the same percentage in all
    recordings. In the second, thrust grows as if the voltage rose by the same number of volts.
    Growths count as the same if they are positive and the largest is less than `LARGEST_RATIO`
    times the smallest. The function yields nothing if all recordings have the same voltage, or if
    roll creeps in none of them.
    """
    if len({c.voltage_V for c in runs}) < 2 or not any(c.creeps for c in runs):
        return
    growth = {
        "thrust": [c.thrust_late_over_early - 1 for c in runs],
        "voltage": [c.as_if_V for c in runs],
    }
    one = {k: min(v) > 0 and max(v) < LARGEST_RATIO * min(v) for k, v in growth.items()}
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


def arm_torque(fit: MultiStepFit | GreyBoxModel, roll_deg: float) -> float:
    """Return the torque Γ(r) in N·m that the lift balances at this roll angle."""
    at = dict(zip(fit.structure.names, fit.values, strict=True))
    r = np.radians(roll_deg)
    torque = (at["T_g"] + at.get("mass.imbalance.torque_Nm", 0.0)) * np.cos(r)
    return float(torque + at.get(PENDULUM, 0.0) * np.sin(r))


def steady_rows(recording: Recording) -> np.ndarray:
    """Return (n, 3): roll (°), pitch (°) and mean motor voltage (V) of the n rows in steady flight.

    The head of this file defines steady flight.
    """
    r = recording
    n = round(STILL_S / r.dt)
    roll = np.degrees(r.angle[:, 0])
    change = np.full(len(r), np.inf)
    change[n // 2 : len(r) - n + n // 2] = np.abs(roll[n:] - roll[:-n])
    rows = (change < STILL_DEG_PER_S * STILL_S) & free_rows(r)
    kernel = np.ones(n) / n
    V = np.convolve(r.voltage.mean(axis=1), kernel, "same")
    return np.asarray(np.column_stack([roll, np.degrees(r.angle[:, 1]), V])[rows])


def explanation_sentences(
    fit: MultiStepFit, recordings: Sequence[Recording], causes: Container[str]
) -> list[str]:
    """Return a sentence for each property of the rig that one of the ``causes`` explains.

    The properties are the mean pitch angle in steady flight, the change of the hover voltage with
    roll, and the dead zone of one motor.
    """
    sentences = []
    rows_by_recording = [steady_rows(r) for r in recordings]
    if OFFSET in fit.by_recording and "encoder.offset.pitch" in causes:
        each = zip(recordings, fit.by_recording[OFFSET], rows_by_recording, strict=False)
        words = "; ".join(
            f"{r.name}: offset {v:.1f}°, mean pitch in steady flight {s[:, 1].mean():.1f}°"
            for r, v, s in each
            if len(s)
        )
        sentences.append(
            f"Pitch in steady flight is the encoder's zero offset (encoder.offset.pitch): {words}."
        )
    rows = np.concatenate(rows_by_recording)
    if "stiffness.pendulum.roll" in causes and len(rows) > 10:
        slope, level = np.polyfit(rows[:, 0], rows[:, 2], 1)
        low, high = (hover_voltage(fit, a) for a in (-10, 10))
        sentences += pendulum_sentence(level - 10 * slope, level + 10 * slope, low, high)
    if "motor.rotor_curve" in causes and hover_voltage(fit, 0.0) > LEAST_HOVER * LOW_V[1]:
        n = fit.values[fit.structure.names.index(EXPONENT)]
        hover = hover_voltage(fit, 0.0)
        parts = [f"{100 * (v / hover) ** n:.0f} % at {v:g} V" for v in LOW_V]
        sentences.append(
            "The dead zone of one motor is the low end of the thrust curve (motor.rotor_curve, "
            f"n = {n:.2f}): its thrust, relative to level hover ({hover:.1f} V), is "
            f"{' and '.join(parts)}, and zero for negative voltages."
        )
    return sentences


def pendulum_sentence(
    at_minus_10: float, at_10: float, model_minus_10: float, model_10: float
) -> list[str]:
    """Return a list of one sentence: a pendulum explains how the hover voltage varies with roll.

    The arguments are hover voltages (V) at −10° and +10° of roll. ``at_…`` are values of a straight
    line through the measured voltages, ``model_…`` are the model's. If one pair rises with roll and
    the other falls, a pendulum is no explanation, and the list is empty.
    """
    measured, model = at_10 - at_minus_10, model_10 - model_minus_10
    if not measured * model > 0:
        return []
    ratio = model / measured
    also = "" if 1 / LARGEST_RATIO < ratio < LARGEST_RATIO else ", unlike the measurement"
    changes = "rises" if measured > 0 else "falls"
    return [
        f"The hover voltage {changes} with roll because the arm is a pendulum "
        f"(stiffness.pendulum.roll): measured {at_minus_10:.1f} V at −10° and "
        f"{at_10:.1f} V at +10° (a line through the rows with constant roll); the model's are "
        f"{model_minus_10:.1f} V and {model_10:.1f} V{also}."
    ]
