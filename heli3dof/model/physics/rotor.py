"""The rotors: thrusts F_i (N) computed from the recorded voltages V_i, without a Kalman filter.

    τ_m Ḟ_i = K_f g_i f(V_i(t − T)) − F_i,      dF_i/dt ≤ K_f g_i · slew  if a slew limit is set

τ_m is the lag (s), T the delay (s), g_i the gain relative to K_f (N/V), slew in V/s, and f contains
the voltage effects. The solution is exact: the voltage is held between samples, so F approaches its
target as exp(−t/τ_m), and linearly while the slew limit is active. The equation has no noise.
"""

from __future__ import annotations

import math

from heli3dof.model.compiled import inlined
from heli3dof.model.physics import state_layout as _s
from heli3dof.model.physics.compiled_effects import caller

call = caller()
V_FRONT = _s.V_FRONT
TAU_M, DELAY, K_F, GAIN_FRONT, GAIN_BACK = _s.TAU_M, _s.DELAY, _s.K_F, _s.GAIN_FRONT, _s.GAIN_BACK
SLEW = _s.SLEW
VOLTAGE = int(_s.Stage.VOLTAGE)


@inlined
def lagged(F: float, target: float, tau: float, slew: float, h: float) -> float:
    """Return a rotor's thrust (N) after h s, from F (N) at the start: τ Ḟ = target − F.

    ``tau`` (s) is τ; Ḟ is at most ``slew`` (N/s; 0: no limit). The solution is exact: while the
    limit is active, F rises linearly until target − F = slew τ.
    """
    if slew > 0.0 and target - F > slew * tau:
        line = (target - F) / slew - tau
        if h <= line:
            return F + slew * h
        F += slew * line
        h -= line
    if tau <= 0.0:
        return target
    return target + (F - target) * math.exp(-h / tau)


@inlined
def steady_thrusts(s, V, h, lead, k, first, address, par, mem, out):  # type: ignore[no-untyped-def]
    """Write the steady-state thrusts at the voltages of row k to ``out`` (2,), in newtons.

    A row is a sample. ``V`` (rows, 2) are the commanded voltages, in volts. ``h`` (rows,) are the
    times from each row to the next, in seconds. If the rig has a delay, the voltages of earlier
    rows replace those of row k. Rows before ``lead`` are not used: the voltages of row ``lead``
    take their place. Other arguments: see `heli3dof.model.physics.integrator`.
    """
    whole, part = 0, 0.0
    if s[DELAY] > 0.0:
        back = s[DELAY] / h[k]
        whole = int(back)
        part = back - whole
    i = max(lead, k - whole)
    j = max(lead, i - 1)
    for m in range(2):
        out[m] = (1.0 - part) * V[i, m] + part * V[j, m]
        s[V_FRONT + m] = out[m]
    for e in range(first[VOLTAGE], first[VOLTAGE + 1]):
        call(address, e, s, par, mem, out)
    out[0] *= s[K_F] * s[GAIN_FRONT]
    out[1] *= s[K_F] * s[GAIN_BACK]


@inlined
def thrusts(s, V, h, lead, stop, first, address, par, mem, target, F):  # type: ignore[no-untyped-def]
    """Compute the rotors' thrusts in the rows ``lead`` … ``stop`` − 1 from the voltages V (N, 2).

    A row is a sample. Its voltages (V) act for h[k] s, until the next row. For each row the
    function writes two thrusts per rotor, in newtons:

    - to ``target`` (N, 2), the steady-state thrusts at the row's voltages;
    - to F (N, 2), the actual thrusts at the time of the row, which lag behind.

    The first row, ``lead``, starts with rotors in steady state. Other arguments: see
    `heli3dof.model.physics.integrator`.
    """
    tau = s[TAU_M]
    left, at = 0.0, -1.0
    for k in range(lead, stop):
        steady_thrusts(s, V, h, lead, k, first, address, par, mem, target[k])
        for m in range(2):
            if k == lead:
                F[k, m] = target[k, m]
            elif s[SLEW] > 0.0:
                slew = s[SLEW] * s[K_F] * s[GAIN_FRONT + m]
                F[k, m] = lagged(F[k - 1, m], target[k - 1, m], tau, slew, h[k - 1])
            else:
                if h[k - 1] != at:
                    at = h[k - 1]
                    left = math.exp(-at / tau) if tau > 0.0 else 0.0
                F[k, m] = target[k - 1, m] + (F[k - 1, m] - target[k - 1, m]) * left
