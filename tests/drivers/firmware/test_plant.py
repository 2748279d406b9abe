"""The bench behind the firmware (Kane, in C) against the emulated rig (Lagrange, in Python)."""

from __future__ import annotations

import numpy as np
from heli3dof_drivers.emulator.body import body_of
from heli3dof_drivers.emulator.lagrange import accelerations

from heli3dof.rig.profile import default_profile

from .building import run

DAMPING = np.array([0.05, 0.004, 0.05])
"""N·m·s/rad: roll, pitch, yaw of the bench plant"""


def test_two_derivations_of_the_rigid_body_agree_in_every_position():
    rng = np.random.default_rng(5)
    q = rng.uniform(-1.2, 1.2, (200, 3))
    qd = rng.uniform(-3, 3, (200, 3))
    V = rng.uniform(-24, 24, (200, 2))
    text = "\n".join(" ".join(f"{x:.17g}" for x in row) for row in np.hstack([q, qd, V]))
    in_c = np.array([line.split() for line in run("heli3dof-replay", "--plant", text=text)], float)
    profile = default_profile()
    body, in_python = body_of(profile).vector(), np.empty((200, 3))
    F = profile.motor.K_f * V
    for k in range(200):
        torque = -DAMPING * qd[k]
        accelerations(body, q[k], qd[k], F[k, 0], F[k, 1], torque, in_python[k])
    np.testing.assert_allclose(in_c, in_python, rtol=1e-9, atol=1e-9)
