"""No safety monitor ends a flight as planned: every plan that ships, on several rigs."""

from __future__ import annotations

import pytest

from heli3dof.experiment.control_loop.loop import fly
from heli3dof.experiment.control_loop.outcome import Outcome
from heli3dof.experiment.fly import prepare
from heli3dof.experiment.plan import load_plan
from heli3dof.experiment.safety_monitors import monitors_for
from heli3dof.recording.row import Row
from heli3dof.rig.drivers import open_driver
from tests.paths import ROOT
from tests.profiles import profile as profile_at

PLANS = sorted(p.stem for p in (ROOT / "heli3dof" / "experiment" / "plans").glob("*.toml"))
RIGS = {
    "plain": "seed={seed}",
    "without noise": "seed={seed}&noise=0",
    "with dry friction": "seed={seed}&hide=friction.coulomb.roll:0.2,friction.coulomb.pitch:0.04,"
    "friction.coulomb.yaw:0.1",
    "with backlash": "seed={seed}&hide=encoder.backlash.roll:1,encoder.backlash.pitch:1,"
    "encoder.backlash.yaw:1",
    "slow and weak": "seed={seed}&hide=motor.lag:0.15,motor.thrust_gain:0.8",
    "unlike its profile": "seed={seed}&spread=0.3",
    "losing samples": "seed={seed}&hide=timing.gaps:0.3,timing.jitter:0.0008",
}


PAIRS = [(plan, list(RIGS)[n % len(RIGS)]) for n, plan in enumerate(PLANS)]
"""A rig for every plan, and every rig; run as a module, this file flies every pair."""


class Nowhere:
    """A recorder that discards its rows."""

    def append(self, row: Row) -> None:
        pass


def flown(plan: str, rig: str, rate_hz: float = 500.0) -> Outcome:
    # A seed of its own for every pair.
    seed = 1 + PLANS.index(plan) + len(PLANS) * list(RIGS).index(rig)
    profile = profile_at(rate_hz=rate_hz).with_controller()
    open_one = open_driver("mock:?speed=max&" + RIGS[rig].format(seed=seed), profile)
    signals = prepare(load_plan(plan), profile, seed)
    monitors = monitors_for(profile)
    return fly(open_one, profile, signals, Nowhere(), monitors=monitors)


@pytest.mark.parametrize(("plan", "rig"), PAIRS)
def test_a_plan_is_flown_to_its_end(plan: str, rig: str) -> None:
    """Every second plan at 250 Hz, the others at the default rate of 500 Hz."""
    outcome = flown(plan, rig, 250.0 if PLANS.index(plan) % 2 else 500.0)
    assert (outcome.ending, outcome.detail) == ("completed", "the plan was flown to its end")


if __name__ == "__main__":
    for plan in PLANS:
        for rig in RIGS:
            print(plan, rig, flown(plan, rig).detail, sep=" · ")
