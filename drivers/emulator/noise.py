"""Process noise: a random torque on each axis, from the air and the rotors.

Each torque w is an Ornstein–Uhlenbeck process with white noise ξ. It is discretised exactly,
with the control period dt, and held for each period::

    τ_c ẇ = −w + √(2 τ_c) σ ξ(t)
    w[k+1] = a w[k] + σ √(1 − a²) N(0, 1),    a = exp(−dt/τ_c)

So for any dt, w has the standard deviation σ (N·m) and the correlation time τ_c (s).

σ was chosen by comparing a closed-loop run with noise (angles y) and the same run without noise
(angles ŷ). The controller is the default one; the runs start level. An axis' fit is
100 (1 − ‖y − ŷ‖/‖y − mean y‖) %. For three flight plans, the table shows the mean fit over the
noise seeds 1–6, for roll / pitch / yaw. The last column is the range of the pitch fit over these
seeds. The plans' random signals have seed 1:

==============  ======================  ===============
plan            mean fit, %             pitch fit, %
==============  ======================  ===============
``multisine``   99.1 / 93.8 / 98.9      92.8 … 94.6
``steps``       99.0 / 94.6 / 99.2      93.7 … 95.2
``large``       99.5 / 96.6 / 99.6      96.1 … 97.1
==============  ======================  ===============

So no model can fit a run's pitch much better than this in closed-loop replay. Below 16 Hz the noise
is almost white. It causes accelerations with the amplitude spectral density σ √(2 τ_c) / J, J the
axis' inertia: 0.0054 (roll), 0.0136 (pitch) and 0.0022 (yaw) rad/s² per √Hz (two-sided) on the
paper's rig.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

SIGMA_NM = (0.035, 0.0035, 0.015)
"""N·m, standard deviation on roll, pitch and yaw at ``noise=1``"""
CORRELATION_S = 0.01
"""s, the correlation time τ_c"""
VIBRATION_DAMPING = 0.02
"""Damping ratio of the vibrating mode"""
BLOCK = 512
"""Periods that are drawn at once"""


class TorqueNoise:
    """Draws random torques (3,) in N·m for each control period of ``dt`` s.

    ``scale`` multiplies the standard deviations σ (`SIGMA_NM`). ``correlation_s``: correlation time
    τ_c, s. With a τ_c other than the default, σ is changed so that σ² τ_c stays the same. So the
    spectral density at low frequencies, which is proportional to σ² τ_c, does not change.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        dt: float,
        scale: float,
        correlation_s: float = CORRELATION_S,
    ) -> None:
        self._rng = rng
        self._a = math.exp(-dt / correlation_s)
        self._sigma = scale * math.sqrt(CORRELATION_S / correlation_s) * np.array(SIGMA_NM)
        self._w = self._sigma * rng.standard_normal(3)
        # Fill now: the first call compiles, which must not happen while the motors turn.
        self._fill()

    def draw(self) -> np.ndarray:
        """Return the random torques (3,) in N·m on roll, pitch and yaw for the next period."""
        if self._next == len(self._block):
            self._fill()
        row: np.ndarray = self._block[self._next]
        self._next += 1
        return row

    def _fill(self) -> None:
        drive = self._sigma * math.sqrt(1 - self._a**2) * self._rng.standard_normal((BLOCK, 3))
        self._block = _correlate(self._w, self._a, drive)
        self._next = 0


class Vibration:
    """Draws torques τ (3,), N·m, of a randomly excited vibration, one set per control period.

    τ[k] = Re z[k], z[k+1] = a z[k] + σ √(1 − |a|²) (N(0, 1) + i N(0, 1)), a = e^{(−ζ + i) ω dt}.

    z (3,) is the complex state of a lightly damped mode on each axis. σ, the standard deviation of
    τ, is ``scale`` times `SIGMA_NM`; ω = 2π ``hertz``; ζ is the damping ratio `VIBRATION_DAMPING`;
    ``dt`` is the control period in s.
    """

    def __init__(self, rng: np.random.Generator, dt: float, scale: float, hertz: float) -> None:
        w = 2 * math.pi * hertz
        self._rng = rng
        self._a = complex(math.cos(w * dt), math.sin(w * dt)) * math.exp(
            -VIBRATION_DAMPING * w * dt
        )
        self._sigma = scale * np.array(SIGMA_NM)
        self._drive = self._sigma * math.sqrt(1 - abs(self._a) ** 2)
        self._z = self._sigma * self._two()

    def draw(self) -> np.ndarray:
        """Return the vibration torques (3,) in N·m on roll, pitch and yaw for the next period."""
        torque: np.ndarray = self._z.real.copy()
        self._z = self._a * self._z + self._drive * self._two()
        return torque

    def _two(self) -> np.ndarray:
        real, imaginary = self._rng.standard_normal((2, 3))
        return np.asarray(real + 1j * imaginary)


@njit(cache=True)
def _correlate(w: np.ndarray, a: float, drive: np.ndarray) -> np.ndarray:
    """Return n torques τ[0] … τ[n−1] (n, 3) in N·m, where τ[k+1] = ``a`` τ[k] + ``drive``[k].

    ``w`` (3,) contains τ[0]. The function overwrites it with τ[n], the first torque of the next
    call. ``drive`` (n, 3): white noise in N·m.
    """
    block = np.empty_like(drive)
    for k in range(len(drive)):
        for i in range(3):
            block[k, i] = w[i]
            w[i] = a * w[i] + drive[k, i]
    return block
