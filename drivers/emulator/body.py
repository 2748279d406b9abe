"""Computes the emulated rig's parameters from a profile, with an optional random spread."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from heli3dof.errors import UsageError

from . import plant_layout as at

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile

g = 9.81
"""m/s², gravitational acceleration"""

ROLL_STOP_DEG = 36.0
PITCH_STOP_DEG = 32.0
"""°: `ROLL_STOP_DEG` is the upper stop of roll, ±`PITCH_STOP_DEG` are the stops of pitch"""


@dataclass(frozen=True)
class Body:
    """Parameters of the rigid body and the motors, in SI units; `lagrange` defines the symbols."""

    L_a: float
    """m, from the vertical axis to the pitch axis"""
    L_h: float
    """m, from the pitch axis to each motor"""
    K_f: float
    """N/V, thrust of one motor per volt"""
    T_g: float
    """N·m, gravity torque of the level arm"""
    J_w: float
    """kg·m², inertia of the counterweight"""
    I_aa: float
    """kg·m², inertia of the motors about e_a, the arm"""
    I_bb: float
    """kg·m², inertia of the motors about b, the body's bar"""
    I_ab: float
    """kg·m², product of inertia of the motors about e_a and b"""
    G_p: float
    """N·m, gravity torque on the level body; positive if the front motor is the heavier one"""
    V_ref: float
    """V at which effect ``motor.thrust_curve`` leaves the thrust unchanged"""
    dJ: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """kg·m², additional rotary inertia on the shafts of roll, pitch and yaw"""
    tau_m: float = 0.0
    """s, the rotors' time constant; 0: no lag"""
    gain: tuple[float, float] = (1.0, 1.0)
    """thrust gain of the front and the back motor, relative to K_f"""

    @property
    def J(self) -> tuple[float, float, float]:
        """Return the level rig's inertias of roll, pitch and yaw in kg·m².

        The inertias ``dJ`` of the joints' shafts are not included.
        """
        return self.J_w + self.I_bb, self.I_aa, self.J_w + self.I_bb + self.I_aa

    def vector(self) -> np.ndarray:
        """Return the parameters as an array (BODY_SIZE,) with the indices of `plant_layout`."""
        b = np.zeros(at.BODY_SIZE)
        b[at.L_A], b[at.L_H] = self.L_a, self.L_h
        b[at.K_F], b[at.T_G], b[at.J_W] = self.K_f, self.T_g, self.J_w
        b[at.I_AA], b[at.I_BB], b[at.I_AB] = self.I_aa, self.I_bb, self.I_ab
        b[at.I_NN], b[at.G_P] = self.I_aa + self.I_bb, self.G_p
        b[at.DJ_R], b[at.DJ_P], b[at.DJ_PSI] = self.dJ
        b[at.TAU_M], b[at.V_REF] = self.tau_m, self.V_ref
        b[at.GAIN_FRONT], b[at.GAIN_BACK] = self.gain
        return b


def body_of(profile: Profile) -> Body:
    """Return the rigid body of a profile, with thrust linear in voltage and no hidden effect."""
    m_f, m_b, m_w = profile.mass.m_f, profile.mass.m_b, profile.mass.m_w
    L_w, L_a, L_h = profile.geometry.L_w, profile.geometry.L_a, profile.geometry.L_h
    K_f, V_o = profile.motor.K_f, profile.motor.V_o
    body = Body(
        L_a=L_a,
        L_h=L_h,
        K_f=K_f,
        T_g=2 * L_a * K_f * V_o,
        J_w=m_w * L_w**2,
        I_aa=(m_f + m_b) * L_h**2,
        I_bb=(m_f + m_b) * L_a**2,
        I_ab=-(m_f - m_b) * L_a * L_h,
        G_p=(m_f - m_b) * g * L_h,
        V_ref=abs(V_o) or profile.motor.v_max,
    )
    if profile.inertia is None:
        return body
    # Measured inertias: their excess over those of the point masses is put on the shafts.
    given = (profile.inertia.roll, profile.inertia.pitch, profile.inertia.yaw)
    roll, pitch, yaw = (J - m if J else 0.0 for J, m in zip(given, body.J, strict=True))
    return replace(body, dJ=(roll, pitch, yaw))


def spread_body(body: Body, spread: float, rng: np.random.Generator) -> Body:
    """Return ``body`` with random thrust per volt, gravity torque and inertias.

    K_f, T_g, the counterweight's inertia J_w and the body's inertias I_aa and I_bb are each
    multiplied by 1 + u, each with its own u. u is drawn from ``rng``, uniform within ± ``spread``.
    The product of inertia I_ab scales with √(I_aa I_bb). The lengths are unchanged, because they
    are easily measured.
    """
    k = 1 + spread * rng.uniform(-1, 1, size=5)
    return replace(
        body,
        K_f=body.K_f * k[0],
        T_g=body.T_g * k[1],
        J_w=body.J_w * k[2],
        I_aa=body.I_aa * k[3],
        I_bb=body.I_bb * k[4],
        I_ab=body.I_ab * math.sqrt(k[3] * k[4]),
    )


@dataclass(frozen=True)
class Setup:
    """An emulated rig before it runs: body, initial angles, mechanical stops, sampling errors.

    The sampling errors are jitter and lost samples. `Effect.setup` may change any field.
    """

    body: Body
    nominal: Body
    """The profile's body, without spread"""
    rest: tuple[float, float, float]
    """rad, the angles at which the encoder counts are zero"""
    start: tuple[float, float, float]
    """rad, the initial angles"""
    low: tuple[float, float, float]
    """rad, lower stops; the roll's is the table"""
    high: tuple[float, float, float]
    """rad, upper stops"""
    lost_share: float = 0.0
    """Share of samples that are lost"""
    jitter_s: float = 0.0
    """s, standard deviation of the sampling instants about the even grid"""

    def vector(self, rad_per_count: np.ndarray) -> np.ndarray:
        """Return `Body.vector` with the rest angles, the stops and the encoders' resolution."""
        b = self.body.vector()
        b[at.REST : at.REST + 3], b[at.LOW : at.LOW + 3] = self.rest, self.low
        b[at.HIGH : at.HIGH + 3] = self.high
        b[at.COUNTS_PER_RAD : at.COUNTS_PER_RAD + 3] = 1 / rad_per_count
        return b


def setup_of(profile: Profile, start: str) -> Setup:
    """Return the emulated rig of a profile, at rest on its table or level.

    ``start``: ``rest`` for the profile's rest angles, at which the encoder counts are zero, or
    ``level`` for zero angles. Raises UsageError if roll's rest angle is outside −90 … 0°, or
    pitch's beyond its mechanical stops.
    """
    body = body_of(profile)
    rest = tuple(profile.encoder.rest_rad.tolist())
    roll_stop, pitch_stop = math.radians(ROLL_STOP_DEG), math.radians(PITCH_STOP_DEG)
    for axis, angle, low, high in (
        ("roll", rest[0], -math.pi / 2, 0.0),
        ("pitch", rest[1], -pitch_stop, pitch_stop),
    ):
        if not low <= angle <= high:
            raise UsageError(
                f"The emulated rig cannot rest at {axis} {math.degrees(angle):g}°.",
                cause=f"the profile's {axis}_rest_deg must lie between {math.degrees(low):g}° and "
                f"{math.degrees(high):g}°.",
                fix=f"correct encoder.{axis}_rest_deg in the profile",
            )
    return Setup(
        body=body,
        nominal=body,
        rest=rest,
        start=rest if start == "rest" else (0.0, 0.0, 0.0),
        low=(rest[0], -pitch_stop, -math.inf),
        high=(roll_stop, pitch_stop, math.inf),
    )
