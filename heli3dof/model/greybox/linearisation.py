"""Trim and linearisation of a grey-box model at level hover, for poles, Bode plots and loop checks.

    z = (r, p, ψ, ṙ, ṗ, ψ̇, F_f, F_b) − trim,      ż = A z + B (V − u0)

A and B contain central differences of the accelerations and of the steady-state thrusts K_m V. With
the rotors' lag τ, Ḟ = (K_m V − F)/τ. r, p, ψ are roll, pitch, yaw, F_f and F_b the thrusts, V the
motor voltages, u0 those at trim. A zero-order hold converts A and B to discrete time. A delay then
appends delayed voltages to z. Dry friction has no linearisation and is omitted. An encoder with
backlash is linearised in the middle of the backlash.

At trim, the thrusts balance roll and pitch. No thrust balances a constant yaw torque τ
(``bias.torque.yaw``) at level, so it accelerates yaw by ψ̈_0 = τ/J_ψ. Through the inertias M_rψ and
M_pψ (`heli3dof.model.physics.rigid_body`), ψ̈_0 adds −ψ̈_0 r to p̈ and −ψ̈_0 p J_p/J_r to r̈.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from heli3dof.errors import CheckFailed
from heli3dof.model.discretisation import HOVER_STATES, Continuous, c2d_zoh
from heli3dof.model.linear.model import LinearModel
from heli3dof.model.physics import state_layout
from heli3dof.model.physics.integrator import readings, setup
from heli3dof.model.physics.rigid_body import accelerations
from heli3dof.model.physics.rotor import steady_thrusts

if TYPE_CHECKING:
    from heli3dof.model.greybox.model import GreyBoxModel
    from heli3dof.model.physics.parametrisation import Structure

STEP = 0.05
"""Step of the differences in the delta method, as a share of the parameter's standard deviation.
Chosen: small enough for a straight line, and far above rounding errors."""


class Valued(Protocol):
    """A grey-box model, or a fit of one: its structure, and the parameters' values (n,)."""

    @property
    def structure(self) -> Structure: ...
    @property
    def values(self) -> np.ndarray: ...


@dataclass(frozen=True)
class LevelHover:
    """The motor voltage at which a grey-box model hovers level, and its thrust per volt there.

    V_h (V) is the mean voltage of the two motors, and F_h (N) their mean thrust. In a rig's
    profile, the thrust is K_f times the voltage. If the model's thrust is nonlinear, F_h/V_h
    differs from the profile's K_f. A profile with the hover voltage V_o = V_h and the thrust gain
    K_f = F_h/V_h has the same voltage and thrust in level hover as the model.
    """

    voltage_V: float
    std_V: float
    """Standard deviation of ``voltage_V``, from the parameters' covariance (delta method)"""
    thrust_N_per_V: float
    """F_h/V_h; K_f if V_h is 0"""


class _Plant:
    """The equations of a grey-box model as functions of arrays, with or without its motor delay."""

    def __init__(self, model: Valued, *, delayed: bool = True) -> None:
        self.s, *self.effects = model.structure.arguments(model.values)
        setup(self.s, *self.effects)
        self.delay = float(self.s[state_layout.DELAY])
        if not delayed:
            self.s[state_layout.DELAY] = 0.0
        self.free = np.ones(3, dtype=bool)
        self.thrusts = np.empty(2)
        """N, after the effects on the thrust: set by `acceleration`"""

    def acceleration(
        self, q: np.ndarray, F: np.ndarray, rate: np.ndarray | float = 0
    ) -> np.ndarray:
        """Return the accelerations (3,) rad/s²; q (3,) rad, F (2,) N: thrusts, rate (3,) rad/s."""
        a = np.empty(3)
        self.s[state_layout.R : state_layout.R + 3] = q
        self.s[state_layout.R_DOT : state_layout.R_DOT + 3] = rate
        self.s[state_layout.F_FRONT : state_layout.F_FRONT + 2] = F
        accelerations(self.s, *self.effects, self.free, self.thrusts, np.empty(3), a)
        return a

    def steady_thrusts(self, V: np.ndarray) -> np.ndarray:
        """Return the steady-state thrusts (2,) N at constant motor voltages V (2,) V."""
        out = np.empty(2)
        steady_thrusts(self.s, V.reshape(1, 2), np.ones(1), 0, 0, *self.effects, out)
        return out


def true_angles(model: GreyBoxModel, read: np.ndarray) -> np.ndarray:
    """Return the true angles (3,) rad at the encoder readings ``read`` (3,) rad."""
    plant = _Plant(model)
    q, m, slope = np.array(read, dtype=float), np.empty(3), np.empty(3)
    for _ in range(3):
        readings(plant.s, np.concatenate([q, np.zeros(3)]), *plant.effects, m, slope)
        q = q - (m - read) / slope
    return q


def balance(model: Valued, q: np.ndarray) -> np.ndarray:
    """Return the thrusts (2,) N that balance roll and pitch at rest at the angles q (3,) rad.

    If Newton's method diverges, returns its last finite thrusts, which do not balance the model.
    """
    plant = _Plant(model)
    F = np.full(2, 0.5 * plant.s[state_layout.T_G] / plant.s[state_layout.L_A])
    for _ in range(20):
        a = plant.acceleration(q, F)[:2]
        J = np.column_stack(
            [(plant.acceleration(q, F + e)[:2] - a) / 1e-4 for e in 1e-4 * np.eye(2)]
        )
        if not (np.isfinite(J).all() and np.isfinite(a).all()):
            break
        change = np.linalg.lstsq(J, -a, rcond=None)[0]
        F = F + change
        if np.abs(change).max() < 1e-12:
            break
    return np.asarray(F)


def trim_voltage(model: Valued, F: np.ndarray) -> np.ndarray:
    """Return the voltages (2,) V that hold the thrusts F (2,) N; raise CheckFailed if none does."""
    plant = _Plant(model, delayed=False)
    V = np.full(2, model.structure.profile.motor.V_o)
    for _ in range(60):
        miss = plant.steady_thrusts(V) - F
        J = _jacobian(plant.steady_thrusts, V, np.full(2, 1e-3))
        if not (np.isfinite(J).all() and np.isfinite(miss).all()):
            break
        change = np.linalg.lstsq(J, -miss, rcond=1e-6)[0]
        V = V + np.clip(change, -3.0, 3.0)
        if np.abs(miss).max() < 1e-10:
            return np.asarray(V)
    if np.abs(plant.steady_thrusts(V) - F).max() < 1e-6:
        return np.asarray(V)
    raise CheckFailed(
        f"The model cannot hover level: no voltage gives the thrusts {F[0]:.3g} and {F[1]:.3g} N.",
        cause="a fit to too little data, or a thrust curve with a maximum below this thrust.",
        fix="identify from a recording with larger motion (heli3dof run large)",
    )


def hover_voltage(model: Valued, roll_deg: float = 0.0) -> float:
    """Return the voltage (V, mean of both motors) that holds the arm at a roll angle, pitch 0.

    Raises CheckFailed if no voltage does.
    """
    return float(_hover(model, roll_deg)[0].mean())


def equilibrium_deg(model: Valued, voltage_V: float) -> float:
    """Return the roll angle (°) of the equilibrium with ``voltage_V`` on both motors, at pitch 0.

    The model omits the table on which the rig rests before take-off, so the result may lie below
    it. The search covers −60° to 60° in steps of 0.1°.
    """

    def voltage_or_nan(roll_deg: float) -> float:
        try:
            return hover_voltage(model, roll_deg)
        except CheckFailed:  # no voltage holds the arm at this angle
            return float("nan")

    coarse = np.linspace(-60, 60, 61)
    angles = np.linspace(-60, 60, 1201)
    needed = np.interp(angles, coarse, [voltage_or_nan(a) for a in coarse])
    return float(angles[int(np.nanargmin(np.abs(needed - voltage_V)))])


def level_hover(model: GreyBoxModel) -> LevelHover | None:
    """Return the level hover of ``model``; None if no voltage holds it level."""
    try:
        V, F = _hover(model)
        std_V = _delta_std(model)
    except CheckFailed:
        return None
    total = float(V.sum())
    K_f = float(F.sum()) / total if abs(total) > 1e-6 else model.profile.motor.K_f
    return LevelHover(total / 2, std_V, K_f)


def _hover(model: Valued, roll_deg: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return the motors' voltages (2,) V and thrusts (2,) N at rest at a roll angle, pitch 0."""
    q = np.radians([roll_deg, 0.0, 0.0])
    F = balance(model, q)
    plant = _Plant(model)
    plant.acceleration(q, F)
    return trim_voltage(model, F), plant.thrusts


def _delta_std(model: GreyBoxModel) -> float:
    """Return the level hover voltage's standard deviation (V); unknown covariances count as 0."""
    C = np.nan_to_num(model.covariance)
    gradient = np.zeros(len(C))
    for j in np.flatnonzero(np.diag(C) > 0):
        d = np.zeros(len(C))
        d[j] = STEP * np.sqrt(C[j, j])
        high, low = (hover_voltage(replace(model, values=model.values + e)) for e in (d, -d))
        gradient[j] = (high - low) / (2 * d[j])
    return float(np.sqrt(max(gradient @ C @ gradient, 0.0)))


def linear(model: GreyBoxModel, dt: float) -> tuple[LinearModel, tuple[str, ...]]:
    """Return the linearised model about level hover, sampled every ``dt`` s, and its states' names.

    Level hover is where the encoders read zero. States: r, p, psi, their rates, the thrusts if the
    rotors lag, delayed voltages if there is a delay. Raises CheckFailed if the model cannot hover
    level.
    """
    terms = model.structure.terms
    keep = tuple(t.name for t in terms if state_layout.Stage.DRY not in t.effect.hooks)
    if len(keep) < len(terms):
        given = model.parameters
        smaller = replace(model, terms=keep, values=np.zeros(0))
        model = replace(smaller, values=smaller.structure.values_of(given))
    plant = _Plant(model, delayed=False)
    q = true_angles(model, np.zeros(3))
    F = balance(model, q)
    u0 = trim_voltage(model, F)

    def accelerations_at(z: np.ndarray) -> np.ndarray:
        """Return the accelerations at z: angles, rates, thrusts, voltages."""
        plant.s[state_layout.V_FRONT : state_layout.V_FRONT + 2] = z[8:]
        return plant.acceleration(z[:3], z[6:8], z[3:6])

    z0 = np.concatenate([q, np.zeros(3), F, u0])
    J = _jacobian(accelerations_at, z0, np.repeat([1e-5, 1e-4, 1e-3], [6, 2, 2]))
    K_m = _jacobian(plant.steady_thrusts, u0, np.full(2, 1e-3))
    tau = plant.s[state_layout.TAU_M]
    A, B = np.zeros((8, 8)), np.zeros((8, 2))
    A[:3, 3:6] = np.eye(3)
    A[3:6], B[3:6] = J[:, :8], J[:, 8:]
    if tau > 0.0:
        A[6:, 6:], B[6:] = -np.eye(2) / tau, K_m / tau
    else:  # without lag the thrusts are no states
        A, B = A[:6, :6], B[:6] + A[:6, 6:] @ K_m
    m, slope = np.empty(3), np.empty(3)
    readings(plant.s, z0[:6].copy(), *plant.effects, m, slope)
    C = np.zeros((3, len(A)))
    C[:, :3] = np.diag(slope)
    names = [*HOVER_STATES, "F_front", "F_back"][: len(A)]
    sampled_from = Continuous(A, B, C, np.zeros((3, 2)), "hold") if plant.delay <= 0.0 else None
    A, B, C = _delayed(*c2d_zoh(A, B, dt), C, plant.delay / dt)
    for i in range((len(A) - len(names)) // 2):
        names += [f"v_front_delayed_{i + 1}", f"v_back_delayed_{i + 1}"]
    return LinearModel(
        name=model.name, kind=model.kind, A=A, B=B, C=C, K=np.zeros((len(A), 3)),
        S=np.full((3, 3), np.nan), u0=u0, y0=m, dt=dt, profile=model.profile,
        sampled_from=sampled_from,
    ), tuple(names)  # fmt: skip


def _jacobian(
    f: Callable[[np.ndarray], np.ndarray], at: np.ndarray, steps: np.ndarray
) -> np.ndarray:
    """Return the derivatives (m, n) of f (m,) at the point ``at`` (n,), by central differences."""
    moves = zip(np.diag(steps), steps, strict=True)
    return np.column_stack([(f(at + d) - f(at - d)) / (2 * e) for d, e in moves])


def _delayed(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, periods: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the discrete model (A, B, C) with its input delayed by ``periods`` samples."""
    if periods <= 0.0:
        return A, B, C
    whole = int(periods)
    part = periods - whole
    n, m = len(A), whole + 1
    big = np.zeros((n + 2 * m, n + 2 * m))
    big[:n, :n] = A
    # Delay state i holds V[k−1−i]. The motors get (1 − part) V[k − whole] + part V[k − whole − 1].
    into = np.zeros((n + 2 * m, 2))
    if whole == 0:
        into[:n] = (1 - part) * B
    else:
        big[:n, n + 2 * (whole - 1) : n + 2 * whole] += (1 - part) * B
    big[:n, n + 2 * whole : n + 2 * whole + 2] += part * B
    into[n : n + 2] = np.eye(2)
    big[n + 2 :, n:-2] = np.eye(2 * m - 2)
    return big, into, np.hstack([C, np.zeros((3, 2 * m))])
