"""Cases on other rigs: the hidden effects, sized for each rig, and the truth.

A torque, a stiffness or a damping is scaled with the inertia of its axis, so that it accelerates
the rig as it does the paper's; a voltage is scaled with the hover voltage V_o.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile
from tests.hidden.cases import Case, Class, Hidden, Truth, drawn_effect, drawn_names, plan_named
from tests.hidden.other_rigs import PAPER, OtherRig, draw_rig, fly_rig
from tests.hidden.sizes import EFFECTS, OUTSIDE, Effect, axis_of

RIG_CLASSES = {
    "rigs-single": Class("rich", 1, ("medium", "large"), EFFECTS, 150),
    "rigs-pair": Class("rich", 2, ("medium", "large"), EFFECTS, 45),
    "rigs-outside": Class("rich", 1, ("medium", "large"), OUTSIDE, 30),
    "rigs-nothing": Class("rich", 0, (), {}, 75),
    "rigs-step-nothing": Class("run-step", 0, (), {}, 45),
}
PERIODIC = tuple(f"disturbance.periodic.{axis}" for axis in AXES)


@dataclass(frozen=True)
class RigCase(Case):
    """A case on another rig."""

    rig: OtherRig

    @property
    def plan_name(self) -> str:
        return RIG_CLASSES[self.group].plan

    @property
    def profile(self) -> Profile:
        return self.rig.profile

    @property
    def device(self) -> str:
        return self.rig.url(",".join(h.text for h in self.hidden))

    def fly(self) -> Recording | str:
        hide = ",".join(h.text for h in self.hidden)
        return fly_rig(self.rig, plan_named(self.plan_name), hide)

    def truth(self, recording: Recording) -> Truth:
        """As of any case; what the log itself has and may be named, but need not, is ``unseen``."""
        truth = super().truth(recording)
        rig, unseen = self.rig, list(truth.unseen)
        if rig.burst > 1:
            unseen.append("timing.jitter")
        if "vibration_hz" in rig.options:
            unseen += PERIODIC
        if rig.before_limiter and np.abs(recording.voltage).max() > rig.profile.motor.v_max:
            unseen.append("motor.saturation")
        return replace(truth, unseen=tuple(unseen))


def draw_on_other_rig(group: str, seed: int) -> RigCase:
    """The case of a class and a seed; the same class and seed always give the same case."""
    number = 100 + list(RIG_CLASSES).index(group)
    rng = np.random.default_rng([20_261_124, number, seed])
    wanted = RIG_CLASSES[group]
    rig = draw_rig(1000 * number + seed)
    hidden = tuple(
        sized(
            drawn_effect(wanted.table[name], str(rng.choice(wanted.sizes)), wanted.plan, rng),
            wanted.table[name],
            rig.profile,
        )
        for name in drawn_names(wanted, number, seed, rng)
    )
    if any(h.text.startswith("timing.") for h in hidden):
        rig = replace(rig, burst=1)  # stamps of arrival hide lost and late samples
    return RigCase(group, seed, hidden, rig.seed, rig)


def sized(hidden: Hidden, effect: Effect, profile: Profile) -> Hidden:
    """The effect of the paper's rig, scaled for this one."""
    return replace(hidden, values=(hidden.values[0] * scale(effect, profile), *hidden.values[1:]))


def scale(effect: Effect, p: Profile) -> float:
    """This rig's size of an effect over that on the paper's rig."""
    axis = axis_of(effect.name) or "roll"
    inertia = dict(zip(AXES, np.divide(p.inertias, PAPER.inertias), strict=True))
    volts = p.motor.V_o / PAPER.motor.V_o
    gravity = p.trim_torque / PAPER.trim_torque
    arm = p.geometry.L_a / PAPER.geometry.L_a
    thrust = gravity / arm
    special: Mapping[str, float] = {
        "mass.imbalance": gravity,
        "mass.change": inertia["roll"] / arm,
        "motor.dead_zone": volts,
        "motor.saturation": volts,
        "motor.supply_sag": 1 / volts,
        "aero.reaction_torque": inertia["yaw"] / thrust,
        "aero.inflow": inertia["roll"] / (thrust * arm**2),
        "aero.gyroscopic": inertia["pitch"] / volts,
        "stiffness.pendulum.roll": inertia["roll"],
        "other.pitch_torque_from_voltage_product": inertia["pitch"] / volts**2,
    }
    if effect.name in special:
        return float(special[effect.name])
    if "_N" in effect.parameter:  # torque_Nm, damping_Nms_per_rad, stiffness_Nm_per_rad, …
        return float(inertia[axis])
    return 1.0
