"""The screen and one full fit on flights of the emulated rig; seeds from 1000 on."""

from __future__ import annotations

import numpy as np

from heli3dof.diagnosis.catalogue import Reach, candidates, probes
from heli3dof.diagnosis.screen import screen
from heli3dof.diagnosis.select import extended
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.identification.greybox.method import fit_greybox
from heli3dof.model.effects import term
from heli3dof.recording.recording import Recording


def rich(seed: int, hide: str = "") -> Recording:
    device = f"mock:?speed=max&seed={seed}" + (f"&hide={hide}" if hide else "")
    return fly_plan(load_plan("rich"), device=device, seed=seed).recording


def plain(reach: Reach) -> list:
    """Probes of all but the effects that need many, and of the scale (see nulls)."""
    slow = ("disturbance.periodic", "mass.change", "encoder.scale")
    return [p for t in candidates() if t.effect.name not in slow for p in probes(t, reach)]


def test_a_cable_stiffness_in_yaw_is_named_and_its_size_is_right() -> None:
    found = fit_greybox(rich(1001, "stiffness.cable.yaw:0.05"), ())
    seen = screen(found, plain(Reach(20.0, 60.0)))
    best = int(np.argmax(seen.z**2))
    assert seen.probes[best].name == "stiffness.cable.yaw"
    fit = extended(found, term("stiffness.cable.yaw"), (0.003,), float(seen.amplitude[best]))
    assert abs(fit.values[-1] - 0.05) < max(4 * fit.std[-1], 0.05 * 0.05)


def test_where_nothing_is_hidden_no_probe_stands_out() -> None:
    seen = screen(fit_greybox(rich(1003), ()), plain(Reach(20.0, 60.0)))
    assert np.abs(seen.z).max() < 4.0


def test_the_base_s_own_parameters_are_no_candidates() -> None:
    names = {t.effect.name for t in candidates()}
    assert not names & {"inertia", "mass.imbalance", "motor.thrust_gain"}
    assert "stiffness.cable.yaw" not in {t.name for t in candidates(["stiffness.cable.yaw"])}
