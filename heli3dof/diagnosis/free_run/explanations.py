"""Explain known properties of a rig by its fitted model, in sentences with measured numbers.

In steady level flight, both motors at voltage V give the thrust F (N, `motor.rotor_curve`):

    F = 2 K_f V_o (V/V_o)^n
    L_a F = Γ(r) = (T_g + τ) cos r + k_r sin r               gives the hover voltage at each roll r
    F(V)/F(V_hover) = (V/V_hover)^n                          gives one motor's thrust at low voltage

T_g, τ and k_r (N·m) are trim torque, `mass.imbalance` and pendulum torque. L_a (m) is the arm's
length, K_f (N/V) the thrust gain, V_o (V) the operating voltage. Rows are in steady flight if the
mean roll rate over `STILL_S` is below `STILL_DEG_PER_S`.
"""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np

from heli3dof.identification.greybox.freeflight import OFFSET, free_rows
from heli3dof.identification.greybox.multistep import MultiStepFit
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.recording.recording import Recording

STILL_S = 0.5
STILL_DEG_PER_S = 3.0
"""s, °/s: averaging time and largest mean roll rate of steady flight. Chosen; not derived."""
LOW_V = (2.0, 3.5)
"""V: two voltages in the dead zone of one motor, as users observe it"""
LEAST_HOVER = 2.0
"""Least ratio of hover voltage to the higher `LOW_V` at which a dead zone is reported. Chosen."""
SLOPE_RATIO = 2.0
"""Largest ratio of two slopes that agree. Chosen; not derived."""
PENDULUM = "stiffness.pendulum.roll.torque_Nm"
EXPONENT = "motor.rotor_curve.exponent"


def arm_torque(fit: MultiStepFit | GreyBoxModel, roll_deg: float) -> float:
    """Return the torque Γ(r) in N·m that the lift balances at this roll angle."""
    at = dict(zip(fit.structure.names, fit.values, strict=True))
    r = np.radians(roll_deg)
    torque = (at["T_g"] + at.get("mass.imbalance.torque_Nm", 0.0)) * np.cos(r)
    return float(torque + at.get(PENDULUM, 0.0) * np.sin(r))


def hover_voltage(fit: MultiStepFit | GreyBoxModel, roll_deg: float) -> float:
    """Return the voltage of each motor (V) that holds the arm at this roll angle."""
    at = dict(zip(fit.structure.names, fit.values, strict=True))
    p = fit.structure.profile
    lift = arm_torque(fit, roll_deg) / p.geometry.L_a
    hover = p.motor.K_f * abs(p.motor.V_o)
    return float(abs(p.motor.V_o) * max(lift / 2 / hover, 0.0) ** (1 / at.get(EXPONENT, 1.0)))


def settles_at(fit: MultiStepFit | GreyBoxModel, voltage_V: float) -> float:
    """Return the roll (°) of equilibrium with this voltage on both motors; the table is ignored."""
    angles = np.linspace(-60, 60, 1201)
    needed = np.array([hover_voltage(fit, a) for a in angles])
    return float(angles[int(np.argmin(np.abs(needed - voltage_V)))])


def steady_rows(recording: Recording) -> np.ndarray:
    """Return roll (°), pitch (°) and mean voltage (V), (n, 3), of the rows in steady flight."""
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
    """Return a sentence for each property that one of the ``causes`` explains."""
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
    """Return a list: the sentence that a pendulum changes the hover voltage with roll, or nothing.

    Voltages in V at −10° and +10° of roll: on a line through the recordings, and the model's. If
    they change in opposite directions, a pendulum is no explanation, and the list is empty.
    """
    ratio = (model_10 - model_minus_10) / (at_10 - at_minus_10)
    if not ratio > 0:
        return []
    also = "" if 1 / SLOPE_RATIO < ratio < SLOPE_RATIO else ", unlike the measurement"
    changes = "rises" if at_10 > at_minus_10 else "falls"
    return [
        f"The hover voltage {changes} with roll because the arm is a pendulum "
        f"(stiffness.pendulum.roll): measured {at_minus_10:.1f} V at −10° and "
        f"{at_10:.1f} V at +10° (a line through the rows with constant roll); the model's are "
        f"{model_minus_10:.1f} V and {model_10:.1f} V{also}."
    ]
