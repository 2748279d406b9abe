"""A small nonlinear rig for identification tests: RK4 at a quarter of the control period.

    J_r r̈ = L_a cos p F − T_g cos r − k_r sin r − c_r ṙ + w_r
    J_p p̈ = L_h D − k_p sin p − c_p ṗ + w_p
    J_ψ ψ̈ = −L_a cos r sin p F − c_ψ ψ̇ + w_ψ,      τ Ḟ_i = K_f V_i − F_i

under the default controller, with quantised encoders and w constant over a control period. These
tests need neither a driver nor a recording.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from heli3dof.model.discretisation import c2d_zoh
from heli3dof.model.linear.model import LinearModel
from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.rig.profile import Profile, default_profile

PHYSICS = {
    "J_r": 0.9145, "J_p": 0.03635, "J_y": 0.9508, "L_a": 0.6604, "L_h": 0.1778, "K_f": 0.1188,
    "T_g": 1.170, "k_r": 0.9, "k_p": 0.02, "c_r": 0.05, "c_p": 0.012, "c_y": 0.08, "tau": 0.1,
}  # fmt: skip
NOISE = (0.16, 0.0128, 0.064)
"""N·m, standard deviation of the torque disturbances, redrawn every control period."""


@njit(cache=True)
def _deriv(x, v, w, P):
    J_r, J_p, J_y, L_a, L_h, K_f, T_g, k_r, k_p, c_r, c_p, c_y, tau = P
    r, p, rd, pd, yd = x[0], x[1], x[3], x[4], x[5]
    F, D = x[6] + x[7], x[6] - x[7]
    dx = np.empty(8)
    dx[0:3] = x[3:6]
    torque = L_a * np.cos(p) * F - T_g * np.cos(r) - k_r * np.sin(r) - c_r * rd + w[0]
    dx[3] = torque / J_r
    dx[4] = (L_h * D - k_p * np.sin(p) - c_p * pd + w[1]) / J_p
    dx[5] = (-L_a * np.cos(r) * np.sin(p) * F - c_y * yd + w[2]) / J_y
    dx[6:8] = (K_f * v - x[6:8]) / tau
    return dx


@njit(cache=True)
def _fly(ref, extra, w, P, K_g, V_o, v_max, dt, quantum, r0):
    n = ref.shape[0]
    angle, volt, cmd = np.empty((n, 3)), np.empty((n, 2)), np.empty((n, 2))
    x = np.zeros(8)
    x[0] = r0
    x[6:8] = 0.5 * (P[6] * np.cos(r0) + P[7] * np.sin(r0)) / P[3]
    if r0 < -0.4:
        x[6:8] = 0.0
    om, z = 2 * np.pi * 20.0, 0.9
    # ω²s/(s² + 2ζωs + ω²) by Tustin
    c = 2.0 / dt
    a0, a1, a2 = (
        c * c + 2 * z * om * c + om * om,
        2 * (om * om - c * c),
        c * c - 2 * z * om * c + om * om,
    )
    y1, y2 = np.zeros(3), np.zeros(3)
    d1, d2 = np.zeros(3), np.zeros(3)
    lim, integ = np.zeros(3), np.zeros(2)
    for k in range(n):
        y = np.round(x[:3] / quantum) * quantum
        if k == 0:
            y1[:] = y
            y2[:] = y
            lim[:] = y
        d = (om * om * c * (y - y2) - a1 * d1 - a2 * d2) / a0
        y2[:] = y1
        y1[:] = y
        d2[:] = d1
        d1[:] = d
        step = np.pi / 4 * dt
        lim += np.minimum(np.maximum(ref[k] - lim, -step), step)
        e = lim - y
        for i in range(2):
            v = V_o + extra[k, i]
            for j in range(3):
                v += K_g[i, j] * e[j] - K_g[i, 3 + j] * d[j]
            for j in range(2):
                v += min(max(K_g[i, 6 + j] * integ[j], -7.5), 7.5)
            cmd[k, i] = v
            volt[k, i] = min(max(v, -v_max), v_max)
        integ[0] = min(max(integ[0] + e[0] * dt, -0.75), 0.75)
        integ[1] = min(max(integ[1] + e[2] * dt, -7.5), 7.5)
        angle[k] = y
        h = dt / 4
        for _ in range(4):
            k1 = _deriv(x, volt[k], w[k], P)
            k2 = _deriv(x + h / 2 * k1, volt[k], w[k], P)
            k3 = _deriv(x + h / 2 * k2, volt[k], w[k], P)
            k4 = _deriv(x + h * k3, volt[k], w[k], P)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        if x[0] < -0.48 and r0 < -0.4:
            x[0] = -0.48
            x[3] = max(x[3], 0.0)
    return angle, volt, cmd


def linear_truth(dt: float) -> LinearModel:
    """The rig above linearised about level flight: the best linear model."""
    q = PHYSICS
    A = np.zeros((8, 8))
    A[:3, 3:6] = np.eye(3)
    A[3, [0, 3, 6, 7]] = np.array([-q["k_r"], -q["c_r"], q["L_a"], q["L_a"]]) / q["J_r"]
    A[4, [1, 4, 6, 7]] = np.array([-q["k_p"], -q["c_p"], q["L_h"], -q["L_h"]]) / q["J_p"]
    A[5, [1, 5]] = np.array([-q["T_g"], -q["c_y"]]) / q["J_y"]
    A[6, 6] = A[7, 7] = -1 / q["tau"]
    B = np.zeros((8, 2))
    B[6, 0] = B[7, 1] = q["K_f"] / q["tau"]
    A, B = c2d_zoh(A, B, dt)
    hover = np.full(2, q["T_g"] / (2 * q["L_a"] * q["K_f"]))
    none = np.zeros((8, 3))
    return LinearModel(
        "truth", "statespace", A, B, np.eye(3, 8), none, np.eye(3), hover, np.zeros(3), dt
    )


def steps(n: int, dt: float, size_deg: float, period_s: float, rng: np.random.Generator):
    """(n, 1) rad: random levels within ± size, held for about ``period_s``."""
    out = np.zeros(n)
    k = 0
    while k < n:
        hold = int(period_s * rng.uniform(0.6, 1.4) / dt)
        out[k : k + hold] = rng.uniform(-1, 1) * size_deg
        k += hold
    return np.deg2rad(out)


def multisine(n: int, dt: float, volts: float, rng: np.random.Generator) -> np.ndarray:
    """(n, 2) V: 0.1 to 4 Hz, random phases, independent on the two motors, rms ``volts``."""
    t = np.arange(n) * dt
    f = np.arange(1, 41) / 10.0
    out = np.empty((n, 2))
    for i in range(2):
        s = np.sin(2 * np.pi * f[:, None] * t + rng.uniform(0, 2 * np.pi, (len(f), 1))).sum(0)
        out[:, i] = volts * s / s.std()
    return out


def flight(
    kind: str = "multisine",
    *,
    seed: int = 0,
    seconds: float = 60.0,
    noise: float = 1.0,
    rest: bool = False,
    profile: Profile | None = None,
    **physics: float,
) -> Recording:
    """A closed-loop flight: ``multisine`` (with steps), ``steps`` or ``large``."""
    profile = profile or default_profile()
    rng = np.random.default_rng(seed)
    dt = profile.dt
    n = round(seconds / dt)
    size = {"multisine": (5.0, 10.0), "steps": (8.0, 20.0), "large": (15.0, 60.0)}[kind]
    ref = np.zeros((n, 3))
    ref[:, 0] = steps(n, dt, size[0], 6.0, rng)
    ref[:, 2] = steps(n, dt, size[1], 8.0, rng)
    extra = multisine(n, dt, 1.0, rng) if kind == "multisine" else np.zeros((n, 2))
    w = rng.standard_normal((n, 3)) * np.array(NOISE) * noise / np.sqrt(dt / 0.002)
    P = tuple({**PHYSICS, **physics}.values())
    quantum = np.abs(profile.encoder.rad_per_count)
    assert profile.controller is not None
    y, v, cmd = _fly(
        ref, extra, w, P, profile.controller.K_g, profile.motor.V_o, profile.motor.v_max,
        dt, quantum, -0.48 if rest else 0.0,
    )  # fmt: skip
    return recording_of_arrays(
        np.arange(n) * dt, v, y, profile, reference=ref, voltage_cmd=cmd, voltage_extra=extra,
        meta={"name": f"{kind}-{seed}"},
    )  # fmt: skip
