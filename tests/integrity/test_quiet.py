"""Recordings without faults raise none: clean flights, physical effects, real rigs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import heli3dof as h3
from heli3dof.axes import AXES, MOTORS
from heli3dof.integrity import Kind, checks, integrity
from tests.integrity.flights import flight, names
from tests.pace import timed
from tests.paths import REAL_DATA, needs_real_data

PHYSICS = (
    "motor.lag:0.15,inertia.yaw:1.3",
    "motor.delay:0.03,mass.change:0.1@25",
    "mass.change:0.04@28,inertia.roll:1.7",
    "motor.dead_zone:2.5,encoder.scale.pitch:0.87",
    "motor.saturation:10",
    "motor.thrust_curve:0.9",
    "motor.thrust_gain:0.75,other.yaw_torque_from_pitch_rate:0.3",
    "friction.coulomb.yaw:0.1,stiffness.pendulum.roll:2.5",
    "friction.coulomb.pitch:0.02,friction.coulomb.roll:0.2",
    "encoder.backlash.pitch:1.2",
)


@pytest.mark.parametrize(
    ("plan", "seed"), [("rich", 1201), ("steps", 1201), ("run-step", 1201), ("run-step", 1202)]
)
def test_a_clean_flight_has_no_fault(plan: str, seed: int) -> None:
    assert names(flight(plan, seed=seed, until_s=90.0, rate_hz=500.0)) == set()


@pytest.mark.parametrize(
    ("hide", "plan"), list(zip(PHYSICS, ("rich", "run-step") * (len(PHYSICS) // 2), strict=True))
)
def test_physical_effects_are_not_recording_faults(hide: str, plan: str) -> None:
    assert names(flight(plan, hide), *Kind.ORDER[:3]) == set()


@needs_real_data
def test_real_rigs_report_only_their_sampling_jitter() -> None:
    for rig in ("rig-a", "rig-b"):
        profile = h3.load_profile(REAL_DATA / rig / "profile.toml")
        for path in sorted((REAL_DATA / rig).glob("*.csv")):
            faults = names(h3.load(path, profile), *Kind.ORDER[:3])
            jittery = rig == "rig-a" and path.name.startswith("closed")
            assert faults == ({"timing.jitter"} if jittery else set()), path.name


def test_a_minute_at_500_hz_takes_less_than_half_a_second() -> None:
    r = flight("rich", until_s=90.0, rate_hz=500.0)
    assert timed(lambda: integrity(r)) < 0.5


@given(
    first=st.integers(0, 8000), rows=st.integers(1, 3000),
    missing=st.lists(st.sampled_from(["roll", "pitch", "yaw", "front", "back"]), max_size=4),
    bad=st.sampled_from([np.nan, np.inf, 0.0]),
)  # fmt: skip
@settings(max_examples=40)
def test_no_part_of_a_recording_makes_a_check_fail(
    first: int, rows: int, missing: list[str], bad: float
) -> None:
    r = flight("run-step").rows(slice(first, first + rows))
    angle, voltage = r.angle.copy(), r.voltage.copy()
    for name in missing:
        if name in AXES:
            angle[:, AXES.index(name)] = np.nan
        else:
            voltage[:, MOTORS.index(name)] = bad
    angle[::700] = bad
    for fault in integrity(replace(r, angle=angle, voltage=voltage)):
        assert fault.kind in Kind.ORDER
        assert fault.sentence
        assert fault.fix


def test_every_check_describes_itself() -> None:
    assert len({c.name for c in checks()}) == len(checks()) >= 10
    assert all(c.reports for c in checks())
