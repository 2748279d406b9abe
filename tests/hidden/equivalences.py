"""Effects that no recording of this rig can separate, fixed before any case is judged.

A name is right if it is the hidden effect *or its exact equal in this list*. Effects that are
merely hard to separate (lag and delay, Coulomb and viscous friction on one step) are not listed.
A finding that is confounded with the truth is then right; an asserted name is right or wrong.

1. **One common factor.** Every torque and inertia times one number moves the same way. Sizes are
   compared with the truth in SI nevertheless: the profile gives K_f and the other parameters
   within its tolerance, and the interval includes the resulting uncertainty of K_f.
   `motor.thrust_gain` is K_f/K_f,profile, the rig's own spread included.
2. **A tilted thrust.** With the pitch reading off by δ, p = y − δ, the thrust's torques are
   −L_a F cos r sin(y − δ) on yaw and L_a F cos(y − δ) on roll. To first order in δ that is the rig
   without offset and a couple κF along the body's normal with κ = L_a δ: `aero.reaction_torque`.
   What differs, J_p sin p cos p δ, is 4 % of the inertias times a rate product.
3. **A tilted arm.** With the roll reading off by δ, T_g cos(y − δ) = T_g cos δ cos y + T_g sin δ
   sin y: another T_g, which is free, and `stiffness.pendulum.roll` of k = T_g sin δ.
4. **Where yaw's zero is** enters no equation: `encoder.offset.yaw` cannot be found.
5. **A wrong count per revolution**, y = k q, is another inertia: q̈ = τ/J gives ÿ = τ/(J/k).
   Inertias are free within the tolerance. On yaw only products of rates remain (ψ̇² on roll).
   On pitch the thrust's tilt is off as well, which is another J_ψ. On roll the rest angle is
   right, so the level reading is off by (k − 1)·27.5°, and that is 3.: a pendulum.
   `encoder.scale` is therefore drawn, but no rate of hits counts it: "nothing found" is not a miss.
   Its equals are not wrong names; any other asserted name is wrong.
6. **A limit never reached**: `motor.saturation` above every voltage of the recording.
"""

from __future__ import annotations

_EQUAL = {
    "encoder.offset.pitch": {"aero.reaction_torque"},
    "aero.reaction_torque": {"encoder.offset.pitch"},
    "encoder.offset.roll": {"stiffness.pendulum.roll"},
    "stiffness.pendulum.roll": {"encoder.offset.roll"},
    "encoder.scale.roll": {"inertia.roll", "stiffness.pendulum.roll", "encoder.offset.roll"},
    "encoder.scale.pitch": {"inertia.pitch", "inertia.yaw"},
    "encoder.scale.yaw": {"inertia.yaw"},
}

NEVER_SEEN = frozenset({"encoder.offset.yaw"})
UNRATED = frozenset({"encoder.scale.roll", "encoder.scale.pitch", "encoder.scale.yaw"})


def equals(name: str) -> frozenset[str]:
    """The names that describe the same motion, ``name`` among them."""
    return frozenset({name, *_EQUAL.get(name, ())})
