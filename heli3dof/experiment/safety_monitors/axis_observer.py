"""Computes each axis's expected acceleration α, and observes its motion with a filter.

α follows from the rigid body, one axis at a time (paper, eqs (10) and (11), but not linearised).
V_f, V_b: front and back motor's voltages (V); r, p: roll and pitch (rad); α in rad/s²; L_a: yaw
axis to body (m); L_h: pitch axis to motor (m); K_f: thrust per volt (N/V); V_o: hover voltage (V);
T_g: gravity torque (N·m); J: inertias (kg·m²)::

    α_roll  = (L_a K_f cos p (V_f + V_b) − T_g cos r) / J_roll       T_g = 2 L_a K_f V_o
    α_pitch =  L_h K_f (V_f − V_b) / J_pitch
    α_yaw   = −L_a K_f cos r sin p (V_f + V_b) / J_yaw

A fading-memory α-β-γ filter follows each encoder. Its state is the angle θ, the rate ω and the
unmodelled acceleration b = θ̈ − α. With h the time since the previous sample, Ω the
bandwidth in rad/s and m = exp(−Ω h)::

    predict   θ ← θ + ω h + (α + b) h²/2      ω ← ω + (α + b) h
    correct   e = measured − θ
              θ ← θ + (1 − m³) e     ω ← ω + 1.5 (1 − m)² (1 + m) e/h     b ← b + (1 − m)³ e/h²
"""

from __future__ import annotations

from math import cos, exp, radians, sin

from heli3dof.rig.profile import Profile

ON_TABLE = radians(3.0)
"""rad: an arm less than this above its rest angle may lie on the table"""
PITCH_STOP = radians(25.0)
"""rad: a pitch angle beyond this may be at its mechanical stop (known rigs: ±32°)"""
TILT = radians(10.0)
"""rad: pitch angle for which `ExpectedAcceleration.typical` gives the acceleration of yaw"""
BANDWIDTH = (15.0, 22.0, 15.0)
"""Ω in rad/s for roll, pitch, yaw: faster than the loop's own motion (1 to 5 rad/s). At 500 Hz one
count of quantisation moves the rate by less than 10 counts/s."""
LONGEST_GAP_S = 0.25
"""s without a sample after which the observers restart"""


class ExpectedAcceleration:
    """Computes the angular acceleration α of each axis with the profile's rigid-body model."""

    def __init__(self, profile: Profile) -> None:
        g, motor = profile.geometry, profile.motor
        J_roll, J_pitch, J_yaw = profile.inertias
        self.roll_per_V = g.L_a * motor.K_f / J_roll
        """rad/s² for each volt of V_f + V_b"""
        self.pitch_per_V = g.L_h * motor.K_f / J_pitch
        """rad/s² for each volt of V_f − V_b"""
        self.yaw_per_V = g.L_a * motor.K_f / J_yaw
        """rad/s² for each volt of V_f + V_b and each unit of −cos r sin p"""
        self.gravity = 2 * self.roll_per_V * motor.V_o
        """T_g / J_roll in rad/s²"""
        self.hover_V = motor.hover_V
        """V_h in V, per motor: |V_o|, but at least an eighth of the amplifier's limit"""

    @property
    def typical(self) -> tuple[float, float, float]:
        """Return a typical size of the acceleration α, in rad/s², for roll, pitch and yaw.

        Roll: both motors at the hover voltage `hover_V`, without gravity. Pitch: one motor at this
        voltage. Yaw: both motors at this voltage, and the body pitched by `TILT`.
        """
        return (
            2 * self.roll_per_V * self.hover_V,
            self.pitch_per_V * self.hover_V,
            2 * self.yaw_per_V * self.hover_V * TILT,
        )

    def __call__(
        self, angle: tuple[float, float, float], front_V: float, back_V: float
    ) -> tuple[float, float, float]:
        """Return (α_roll, α_pitch, α_yaw) in rad/s² at these angles (rad) and voltages (V)."""
        total, cos_roll = front_V + back_V, cos(angle[0])
        return (
            self.roll_per_V * cos(angle[1]) * total - self.gravity * cos_roll,
            self.pitch_per_V * (front_V - back_V),
            -self.yaw_per_V * cos_roll * sin(angle[1]) * total,
        )


class AxisObserver:
    """Estimates the motion of one axis by the α-β-γ filter of the module's docstring.

    Estimates: ``angle`` θ (rad), ``rate`` ω (rad/s) and ``unmodelled`` acceleration b (rad/s²).
    ``bandwidth``: Ω in rad/s.
    """

    __slots__ = ("_bandwidth", "_gains", "_h", "angle", "rate", "unmodelled")

    def __init__(self, bandwidth: float) -> None:
        self._bandwidth = bandwidth
        self._h = 0.0
        self._gains = (0.0, 0.0, 0.0)
        self.angle = self.rate = self.unmodelled = 0.0

    def restart(self, angle: float) -> None:
        """Restart the filter at rest at ``angle`` (rad), with zero unmodelled acceleration b."""
        self.angle, self.rate, self.unmodelled = angle, 0.0, 0.0

    def step(self, h: float, acceleration: float, measured: float) -> None:
        """Advance by ``h`` (s), then correct the state with the ``measured`` angle (rad).

        ``acceleration``: the angular acceleration α (rad/s²) that the rigid-body model predicts.
        """
        if abs(h - self._h) > 0.01 * h:
            m = exp(-self._bandwidth * h)
            self._h = h
            self._gains = (1 - m**3, 1.5 * (1 - m) ** 2 * (1 + m) / h, (1 - m) ** 3 / h**2)
        a = acceleration + self.unmodelled
        angle = self.angle + h * self.rate + 0.5 * h * h * a
        error = measured - angle
        gain = self._gains
        self.angle = angle + gain[0] * error
        self.rate += h * a + gain[1] * error
        self.unmodelled += gain[2] * error
