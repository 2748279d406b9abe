"""The emulated rig in a calm hover, under every safety monitor."""

from __future__ import annotations

from heli3dof.experiment.control_loop.loop import fly
from heli3dof.experiment.control_loop.outcome import Outcome
from heli3dof.experiment.fly import prepare
from heli3dof.experiment.plan import plan_from_dict
from heli3dof.experiment.safety_monitors import monitors_for
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.profile import Profile, default_profile
from tests.experiment.safety_monitors.test_false_alarms import Nowhere

NOISE = (0.33, 1.0, 3.0)
"""of the default random torques; seed k uses number k modulo 3"""


def hover(seconds: float, seed: int, options: str = "") -> Outcome:
    """The outcome of a hold."""
    profile = patient(default_profile().with_controller())
    plan = plan_from_dict({"name": "hold", "segment": [{"kind": "hold", "duration_s": seconds}]})
    noise = NOISE[seed % len(NOISE)]
    url = f"mock:?speed=max&start=level&seed={seed}&noise={noise:g}{options}"
    rig = open_driver(url, profile)
    signals = prepare(plan, profile, seed)
    return fly(rig, profile, signals, Nowhere(), monitors=monitors_for(profile))


def patient(profile: Profile) -> Profile:
    """The profile without a limit on the duration of a flight."""
    limits = profile.limits.model_copy(update={"duration_max_s": 1e9})
    return profile.model_copy(update={"limits": limits})
