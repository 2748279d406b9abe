"""Check the closed loop of a profile before a flight: poles, disk margin, reference steps.

The margin is for the sampled loop (filtered rates, integrals), broken at both motors' voltages
simultaneously. At the motors, L(z) is the 2 × 2 loop gain and S = (I + L)⁻¹ the sensitivity. Two
complex factors, f_F and f_B, multiply the front and back voltage independently. Their disk margin
is::

    α = 1 / max_ω μ(S − I/2),       μ: the structured singular value for diag(f_F, f_B)

The loop stays stable if each factor is real, from (1 − α/2)/(1 + α/2) to the inverse of this
number. The loop also stays stable if each factor is a pure phase shift of at most 2 atan(α/2). For
a matrix M = [a b; c d], the diagonal scaling that makes |b| and |c| equal gives μ exactly::

    μ(M)² = (F + √(F² − 4 |det M|²)) / 2,    F = |a|² + |d|² + 2 |b c|

Seiler, Packard and Gahinet, An introduction to disk margins, IEEE Control Systems 40(5), 2020. The
reference steps are simulated on the nonlinear rigid body with quantised encoders, the controller's
limiters and the amplifier's ±v_max.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import atan, degrees

import numpy as np

from heli3dof.arrays import FloatArray
from heli3dof.axes import AXES
from heli3dof.model.base import LoopResult, LoopTask
from heli3dof.model.control.closed_loop_poles import INTEGRATED, sampled_loop_poles
from heli3dof.model.control.controller import derivative_filter
from heli3dof.model.control.stability import MARGIN
from heli3dof.model.greybox.model import nominal
from heli3dof.model.linear.hover import hover_model
from heli3dof.rig.envelope import Envelope
from heli3dof.rig.profile import ControllerSpec, Profile

FREQUENCIES = 600
"""Number of frequencies at which the margin is computed, in a logarithmic grid. Twice as many
change α of the paper's rig by less than 0.001."""
LOWEST_RAD_PER_S = 0.01
"""rad/s, the lowest frequency of the grid: a tenth of the slowest pole of the paper's loop."""
STEP_S = 15.0
"""s, length of a simulated reference step: the paper's loop settles within 7.7 s"""
SMALL_MARGIN = 0.4
"""A disk margin α below this causes a warning. At 0.4, a gain 1.5 times as large or ±23° of phase
may destabilise the loop. The paper's K_g on its rig has about twice this α."""
LARGE_OVERSHOOT = 0.6
"""Overshoot, relative to the reference step, above which there is a warning. The paper's K_g
overshoots a 20° yaw step by 16 % and a roll step by 19 %."""


@dataclass(frozen=True)
class StepCheck:
    """A simulated reference step's result: largest angle and voltage, saturation, safety trip."""

    name: str
    axis: str
    target_deg: float
    peak_deg: float
    highest_V: float
    """V, the largest absolute voltage of either motor"""
    saturated_s: float
    """s, the time with a motor at ±v_max"""
    trip: str | None
    """Text of the safety trip that would end such a flight; None if no monitor would trip"""

    @property
    def overshoot_deg(self) -> float:
        return max(0.0, self.peak_deg - self.target_deg)


@dataclass(frozen=True)
class LoopCheck:
    """The result of `check_loop_of`: the poles of a closed loop.

    If the loop is stable, the result also contains the disk margin and simulated reference steps.
    """

    poles: FloatArray
    """(n,) rad/s, rightmost first, of the sampled loop about hover"""
    disk_margin: float | None = None
    """α, the disk margin at both motors; None if the loop is unstable"""
    steps: tuple[StepCheck, ...] = ()

    @property
    def stable(self) -> bool:
        return bool((self.poles.real < -MARGIN).all())

    @property
    def gain_margin(self) -> float | None:
        """Return the gain margin g > 1 of the two motors; None if the loop is unstable.

        A constant factor may multiply the gain of each motor. The loop stays stable if each factor
        is between 1/g and g. The two factors may differ.
        """
        if self.disk_margin is None:
            return None
        half = min(self.disk_margin / 2, 0.999)
        return (1 + half) / (1 - half)

    @property
    def phase_margin_deg(self) -> float | None:
        """Return the phase margin φ (°) of the two motors; None if the loop is unstable.

        A phase shift may be inserted at each motor. The loop stays stable if each shift is between
        −φ and φ at every frequency. The two shifts may differ, and may depend on the frequency.
        """
        return None if self.disk_margin is None else degrees(2 * atan(self.disk_margin / 2))

    def unusual(self) -> Iterator[str]:
        """Yield a warning for a small margin, saturation, a safety trip or a large overshoot."""
        if not self.stable:
            return
        assert self.disk_margin is not None
        if self.disk_margin < SMALL_MARGIN:
            yield (
                f"the loop's margins are small: a gain {self.gain_margin:.2f} times as large or "
                f"{self.phase_margin_deg:.0f}° of phase may destabilise it; measure K_f, or "
                "design a gain with heli3dof profile new"
            )
        for s in self.steps:
            if s.saturated_s > 0:
                yield (
                    f"{s.name} saturates: a motor is at its limit for {s.saturated_s:.2f} s; the "
                    "gain is too high for this amplifier, or motor.K_f or V_o is off"
                )
            if s.trip is not None:
                yield f"{s.name} would end in a safety trip: {s.trip}"
            elif s.overshoot_deg > LARGE_OVERSHOOT * abs(s.target_deg) > 0:
                yield f"{s.name} overshoots by {s.overshoot_deg:.1f}°"


def check_loop_of(profile: Profile) -> LoopCheck:
    """Return the `LoopCheck` of a profile: the poles of its closed loop with the hover model.

    If the loop is stable, the result also contains the disk margin and simulated reference steps.
    """
    profile = profile.with_controller()
    spec = profile.controller
    assert spec is not None
    poles = sampled_loop_poles(hover_model(profile), spec, profile.dt)
    check = LoopCheck(poles)
    if not check.stable:
        return check
    return LoopCheck(poles, disk_margin(profile, spec), tuple(_steps(profile, spec)))


def disk_margin(profile: Profile, spec: ControllerSpec) -> float:
    """Return the disk margin α at both motors, for the hover model with the controller ``spec``.

    Definition: see the head of this file.
    """
    model = hover_model(profile)
    w = np.geomspace(LOWEST_RAD_PER_S, np.pi / profile.dt, FREQUENCIES)[:-1]
    z = np.exp(1j * w * profile.dt)
    eye = np.eye(model.order)
    P = model.C @ np.linalg.solve(z[:, None, None] * eye - model.A, model.B[None].astype(complex))
    S = np.linalg.inv(np.eye(2) + _controller(spec, profile.dt, z) @ P)
    M = S - 0.5 * np.eye(2)
    F = (
        abs(M[:, 0, 0]) ** 2 + abs(M[:, 1, 1]) ** 2 + 2 * abs(M[:, 0, 1] * M[:, 1, 0])
    )  # squared Frobenius norm, balanced
    det = abs(np.linalg.det(M))
    mu = np.sqrt((F + np.sqrt(np.maximum(F**2 - 4 * det**2, 0.0))) / 2)
    return float(1 / mu.max())


def _controller(spec: ControllerSpec, dt: float, z: FloatArray) -> FloatArray:
    """Return the controller C(z), (n, 2, 3) V/rad, at n values z: voltages = −C(z) · angles."""
    b0, a1, a2 = derivative_filter(spec, dt)
    K = spec.K_g
    rate = b0 * (1 - z**-2) / (1 + a1 * z**-1 + a2 * z**-2)
    C = K[None, :, :3] + K[None, :, 3:6] * rate[:, None, None]
    for column, axis in enumerate(INTEGRATED):
        C[:, :, axis] += K[None, :, 6 + column] * (dt / (z - 1))[:, None]
    return np.asarray(C)


def _steps(profile: Profile, spec: ControllerSpec) -> Iterator[StepCheck]:
    """Simulate a take-off, a roll step and a yaw step under ``spec``; yield each result."""
    N, motor = round(STEP_S / profile.dt), profile.motor
    for name, axis, target, start in (
        ("take-off", 0, 0.0, profile.encoder.rest_rad),
        ("a 10° roll step", 0, 10.0, np.zeros(3)),
        ("a 20° yaw step", 2, 20.0, np.zeros(3)),
    ):
        reference = np.zeros((N, 3))
        reference[:, axis] = np.radians(target)
        flown = nominal(profile).fly(
            LoopTask(
                reference=reference,
                extra=np.zeros((N, 2)),
                angle0=start,
                controller=spec,
                V_o=motor.V_o,
                v_max=motor.v_max,
                dt=profile.dt,
                rad_per_count=profile.encoder.rad_per_count,
                limits=profile.limits,
            )
        )
        angle = np.nan_to_num(flown.angle, nan=np.inf)
        at_limit = (abs(flown.voltage_cmd) >= motor.v_max).any(axis=1)
        yield StepCheck(
            name,
            AXES[axis],
            target,
            float(np.degrees(angle[:, axis].max())),
            float(abs(flown.voltage).max()),
            float(at_limit.sum() * profile.dt),
            _trip(profile, replace(flown, angle=angle)),
        )


def _trip(profile: Profile, flown: LoopResult) -> str | None:
    """Return the first safety trip in a simulated flight as text; None if no monitor trips."""
    envelope = Envelope(profile)
    with np.errstate(invalid="ignore"):
        rate = np.gradient(flown.angle, profile.dt, axis=0)
    arrays = (flown.angle, rate, flown.voltage_cmd, flown.voltage)
    rows = zip(flown.t, *(a.tolist() for a in arrays), strict=True)
    trips = (envelope.check(*row) for row in rows)
    return next((str(trip) for trip in trips if trip is not None), None)
