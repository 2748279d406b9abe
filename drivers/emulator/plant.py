"""Simulates the plant (body, effects, noise and encoders), one control period at a time.

One seed gives four separate streams of random numbers, one for each of these random effects:

- the deviation of the rig's parameters from the profile (``spread``)
- the random torques (``noise``)
- the errors of the sampling times, and lost samples
- the vibration

Switching one of these effects on or off does not change the random numbers of the others. Each
control period has at least `MIN_SUBSTEPS` integration substeps of at most `MAX_SUBSTEP_S` seconds.
"""

from __future__ import annotations

import logging
import math
import threading
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import plant_layout as at
from .body import Body, Setup, spread_body
from .effects import Hidden
from .noise import CORRELATION_S, TorqueNoise, Vibration

MIN_SUBSTEPS = 4
MAX_SUBSTEP_S = 0.5e-3
LARGEST_JITTER = 0.4
"""Largest sampling jitter, as a share of the period: below 0.5, so that samples keep their order"""

log = logging.getLogger("heli3dof.mock")


@dataclass(frozen=True)
class Truth:
    """The simulated rig's true state, body parameters and hidden effects, for tests only."""

    t: float
    """s on the device's clock, which is 0 when the simulation of the motion starts"""
    angle: tuple[float, float, float]
    """rad: roll, pitch, yaw"""
    rate: tuple[float, float, float]
    """rad/s"""
    thrust: tuple[float, float]
    """N, front and back"""
    noise: tuple[float, float, float]
    """N·m, the random torques of the last period"""
    body: Body
    hidden: tuple[Hidden, ...]


class Plant:
    """Simulates a rig's mechanics from motor voltages to encoder counts.

    ``dt``: control period, s; ``noise`` multiplies the random torques; ``noise_s``: correlation
    time of the random torques, s. ``vibration_hz``: frequency of the `Vibration`; 0: no vibration.
    ``spread``: largest relative change of parameters (`spread_body`). The changes are random with
    the seed ``spread_seed``; without it, with ``seed``. ``start_V``: voltage on both motors before
    the start.
    """

    def __init__(
        self,
        setup: Setup,
        rad_per_count: np.ndarray,
        *,
        dt: float,
        hidden: tuple[Hidden, ...] = (),
        seed: int = 0,
        noise: float = 1.0,
        noise_s: float = CORRELATION_S,
        vibration_hz: float = 0.0,
        spread: float = 0.0,
        spread_seed: int | None = None,
        start_V: float = 0.0,
    ) -> None:
        streams = [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(4)]
        if spread:
            rng = streams[0] if spread_seed is None else np.random.default_rng(spread_seed)
            setup = replace(setup, body=spread_body(setup.body, spread, rng))
        # Reverse order: the effects turn angles into readings, ``setup`` readings into angles.
        for h in reversed(hidden):
            if h.effect.setup is not None:
                setup = h.effect.setup(setup, h.axis, h.values)
        self.setup = setup
        self.hidden = hidden
        self.dt = dt
        self.periods = 0
        self.t = 0.0
        self._noise = TorqueNoise(streams[1], dt, noise, noise_s)
        self._vibration = Vibration(streams[3], dt, noise, vibration_hz) if vibration_hz else None
        self._timing = streams[2]
        self._start_V = float(start_V)
        self._substeps = max(MIN_SUBSTEPS, math.ceil(dt / MAX_SUBSTEP_S - 1e-9))
        self._body = setup.vector(rad_per_count)
        hover = setup.body.T_g / (2 * setup.body.L_a) if start_V else 0.0
        self._state = np.array([*setup.start, 0.0, 0.0, 0.0, hover, hover])
        self._w = np.zeros(3)
        self._first, self._address, self._par, self._mem = _attach(hidden)
        self._period, measure = _compiled()
        self.counts: tuple[int, int, int] = measure(
            self._state, 0.0, self._body, self._first, self._address, self._par, self._mem
        )
        """The encoders' counts since power-up: roll, pitch, yaw"""

    def step(self, v_front: float, v_back: float) -> bool:
        """Simulate one control period at these voltages (V); return False if its sample is lost."""
        self._w = self._noise.draw()
        if self._vibration is not None:
            self._w = self._w + self._vibration.draw()
        self.periods += 1
        end = self.periods * self.dt
        if self.setup.jitter_s:
            largest = LARGEST_JITTER * self.dt
            late = self.setup.jitter_s * self._timing.standard_normal()
            end += min(largest, max(-largest, late))
        # Floats only: each combination with integers would be compiled again, for seconds.
        self.counts = self._period(
            self._state, float(v_front), float(v_back), self._w, self.t, end - self.t,
            self._substeps, self._start_V, self._body, self._first, self._address, self._par,
            self._mem,
        )  # fmt: skip
        self.t = end
        lost = self.setup.lost_share
        return not (lost and self._timing.random() < lost)

    @property
    def truth(self) -> Truth:
        s = [float(x) for x in self._state]
        w = [float(x) for x in self._w]
        return Truth(
            t=self.t,
            angle=(s[0], s[1], s[2]),
            rate=(s[3], s[4], s[5]),
            thrust=(s[6], s[7]),
            noise=(w[0], w[1], w[2]),
            body=self.setup.body,
            hidden=self.hidden,
        )


def _attach(hidden: tuple[Hidden, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the arrays ``first``, ``address``, ``par``, ``mem`` by which `kernel` calls effects.

    ``address`` (machine code), ``par`` (parameters) and ``mem`` (memory) have one row per compiled
    function, sorted by `Stage`. The rows of stage i are ``first[i]`` to ``first[i + 1] − 1``.
    """
    calls = [(stage, h) for stage in at.Stage for h in hidden if stage in h.effect.kernels]
    rows = max(1, len(calls))
    par = np.zeros((rows, at.PARAMETER_SIZE))
    mem = np.zeros((rows, at.MEMORY_SIZE))
    address = np.zeros(rows, dtype=np.int64)
    for i, (stage, h) in enumerate(calls):
        address[i] = h.effect.kernels[stage].address
        par[i, at.AXIS] = h.axis
        par[i, at.A : at.A + len(h.values)] = h.values
    per_stage = [sum(1 for c in calls if c[0] is stage) for stage in at.Stage]
    first = np.concatenate([[0], np.cumsum(per_stage)]).astype(np.int64)
    return first, address, par, mem


def _compiled() -> tuple[Any, Any]:
    timer = threading.Timer(
        1.0,
        log.warning,
        ("Compiling the emulated rig; this happens once and takes some seconds …",),
    )
    timer.daemon = True
    timer.start()
    try:
        from . import kernel

        return kernel.compiled()
    finally:
        timer.cancel()
