"""Flies a plan on a model instead of a rig, and records it like a flight."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from heli3dof.errors import UsageError, did_you_mean
from heli3dof.experiment.plan import Plan, checked
from heli3dof.model.base import LoopTask, Model
from heli3dof.model.control.stability import check_loop
from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.recording.row import CLOSED_LOOP
from heli3dof.recording.same_rig import differing_numbers
from heli3dof.rig.profile import Profile, default_profile

Start = Literal["rest", "level"]


def simulate(
    plan: Plan,
    model: Model,
    *,
    profile: Profile | None = None,
    seed: int = 0,
    start: Start = "rest",
    quantised: bool = True,
) -> Recording:
    """Fly a plan in closed loop on a model and return the recording.

    ``profile``: None for the model's own profile, or that of the paper's rig if the model has none.
    A profile without a controller gets the default one.
    ``start``: ``rest`` (on the table, at the profile's rest angles) or ``level``. ``seed``: seed of
    the plan's random signals. ``quantised``: controller and recording get angles rounded to whole
    encoder counts. Raises UsageError for another ``start``, PlanError, or UnstableLoop if the
    controller does not stabilise the model. If ``profile`` is of another rig than the model,
    ``Recording.meta["warnings"]`` states this.
    """
    if start not in get_args(Start):
        raise UsageError(
            f"There is no start {start!r}.",
            cause=f"a typing error; {did_you_mean(str(start), get_args(Start))}",
            fix="start='rest' (on the table), or start='level'",
        )
    profile = (profile or model.profile or default_profile()).with_controller()
    other = differing_numbers(model.profile, profile)
    warning = f"The model {model.name!r} is of another rig than the profile: {other}."
    controller = profile.controller
    assert controller is not None
    signals = checked(plan, profile, seed)
    check_loop(model, controller, profile.dt)
    grid = profile.encoder.rad_per_count
    angle0 = profile.encoder.rest_rad if start == "rest" else np.zeros(3)
    result = model.fly(
        LoopTask(
            reference=signals.reference,
            extra=signals.extra,
            angle0=angle0,
            controller=controller,
            V_o=profile.motor.V_o,
            v_max=profile.motor.v_max,
            dt=profile.dt,
            rad_per_count=grid if quantised else None,
            opened=signals.opened,
            limits=profile.limits,
        )
    )
    # Counts are zero at the start, as in the loop.
    counts = np.round((result.angle - angle0) / grid)
    angle = angle0 + counts * grid if quantised else result.angle
    return recording_of_arrays(
        result.t,
        result.voltage,
        angle,
        profile,
        reference=signals.reference if result.reference is None else result.reference,
        voltage_cmd=result.voltage_cmd,
        voltage_extra=signals.extra if result.extra is None else result.extra,
        channels={"phase": np.full(len(result.t), float(CLOSED_LOOP))},
        meta={
            "name": f"{plan.name}-on-{model.name}",
            "simulated": True,
            "model": model.name,
            "seed": seed,
            "start": start,
            "plan": plan.to_dict(),
            **({"warnings": [warning]} if other else {}),
        },
    )
