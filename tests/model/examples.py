"""What the model tests share: the paper's rig, tasks, and a random stable model."""

from __future__ import annotations

import numpy as np

from heli3dof.model.base import LoopTask
from heli3dof.model.linear.hover import quiescent_voltage
from heli3dof.model.linear.model import LinearModel
from heli3dof.rig.profile import ControllerSpec, Profile, default_profile

PROFILE = default_profile()
SPEC = ControllerSpec()
K_g = SPEC.K_g
DEG = np.pi / 180


def with_motor(profile: Profile, **changes: float) -> Profile:
    return profile.model_copy(update={"motor": profile.motor.model_copy(update=changes)})


PRINTED_V_O = with_motor(PROFILE, V_o=quiescent_voltage(PROFILE))
"""The paper's rig with V_o by eq (6) to every digit, where the profile has 7.456 V."""


def step_task(
    roll: float = 0.0,
    pitch: float = 0.0,
    yaw: float = 0.0,
    *,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    duration_s: float = 15.0,
    spec: ControllerSpec = SPEC,
    dt: float = PROFILE.dt,
    quantised: bool = False,
) -> LoopTask:
    """A step in degrees, from degrees, with the paper's controller."""
    N = round(duration_s / dt)
    return LoopTask(
        reference=np.tile(np.radians([roll, pitch, yaw]), (N, 1)),
        extra=np.zeros((N, 2)),
        angle0=np.radians(start),
        controller=spec,
        V_o=PROFILE.motor.V_o,
        v_max=PROFILE.motor.v_max,
        dt=dt,
        rad_per_count=PROFILE.encoder.rad_per_count if quantised else None,
    )


def in_another_basis(model: LinearModel, seed: int = 0) -> LinearModel:
    """The same model with its state in a random basis: no state of it is physical any more."""
    T = np.random.default_rng(seed).normal(size=(model.order, model.order))
    inverse = np.linalg.inv(T)
    return LinearModel(
        name=model.name,
        kind="statespace",
        A=T @ model.A @ inverse,
        B=T @ model.B,
        C=model.C @ inverse,
        K=T @ model.K,
        S=model.S,
        u0=model.u0,
        y0=model.y0,
        dt=model.dt,
        exact_hold=model.exact_hold,
    )
