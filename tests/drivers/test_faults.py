"""Faults occur at their time and change nothing else."""

from __future__ import annotations

import pytest
from heli3dof_drivers.emulator.faults import KINDS, Fault, parse_faults
from heli3dof_drivers.emulator.transport_pty import emulated
from heli3dof_drivers.link.frames import Arm, Cause, CommandFrame, SampleFrame, Splitter, wire

from heli3dof.errors import UsageError
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.interface import Command, Flags, Sample
from heli3dof.rig.profile import default_profile

PROFILE = default_profile()


def flown(url: str, periods: int = 60) -> list[Sample]:
    """Samples with more voltage in front than behind, so that every axis moves."""
    rig = open_driver(f"mock:?speed=max&start=level&noise=0&{url}", PROFILE)
    rig.arm()
    return [rig.exchange(Command(k + 1, 12.0, 8.0), 0.0) for k in range(periods)]


@pytest.mark.parametrize(
    ("kind", "flag"),
    [
        ("overcurrent", Flags.FAULT),
        ("overtemperature", Flags.FAULT),
        ("stall", Flags.STALL),
        ("button", Flags.ESTOP),
    ],
)
def test_the_amplifier_stops_at_once_until_it_is_armed(kind: str, flag: Flags):
    rig = open_driver(f"mock:?speed=max&fault={kind}@0.05", PROFILE)
    rig.arm()
    samples = [rig.exchange(Command(k + 1, 5.0, 5.0), 0.0) for k in range(60)]
    before = [s for s in samples if s.device_time_s < 0.05 - 1e-9]
    after = samples[len(before) :]
    assert all((s.flags, s.v_applied) == (Flags.ENABLED, (5.0, 5.0)) for s in before)
    assert all((s.flags, s.v_applied) == (flag, (0.0, 0.0)) for s in after)
    assert rig.arm().flags == Flags.ENABLED
    assert rig.exchange(Command(99, 5.0, 5.0), 0.0).v_applied == (5.0, 5.0)


def test_a_frozen_encoder_keeps_its_count_and_the_others_change():
    whole, broken = flown("seed=1"), flown("seed=1&fault=frozen.pitch@0.06")
    moved = [s.counts[1] for s in whole]
    stuck = [s.counts[1] for s in broken]
    assert stuck[:29] == moved[:29]
    assert set(stuck[29:]) == {moved[28]}
    assert moved[-1] > moved[28] + 5
    assert [(s.counts[0], s.counts[2]) for s in whole] == [
        (s.counts[0], s.counts[2]) for s in broken
    ]


def test_a_jump_adds_its_counts_once_and_permanently():
    whole, broken = flown("seed=1"), flown("seed=1&fault=jump.travel@0.06:-200")
    jumped = [b.counts[2] - a.counts[2] for a, b in zip(whole, broken, strict=True)]
    assert jumped == [0] * 29 + [-200] * 31


def test_several_faults_are_sorted_by_time():
    assert parse_faults(["jump.roll@4:3,stall@2", "frozen.elevation@1"]) == (
        Fault("frozen", 1.0, 0),
        Fault("stall", 2.0),
        Fault("jump", 4.0, 0, 3),
    )


@pytest.mark.parametrize("kind", KINDS)
def test_every_example_is_valid(kind: str):
    example, _ = KINDS[kind]
    assert parse_faults([example])[0].kind == kind


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("overcurent@3", "overcurrent"),
        ("overcurrent", "time in s"),
        ("overcurrent@soon", "time in s"),
        ("stall@-1", "time in s"),
        ("stall.roll@3", "a time only"),
        ("frozen@3", "is not an axis"),
        ("frozen.rol@3", "roll"),
        ("frozen.roll@3:1", "no counts"),
        ("jump.roll@3", "counts"),
        ("jump.roll@3:0", "counts"),
        ("jump.roll@3:1.5", "counts"),
    ],
)
def test_a_malformed_fault_is_refused(text: str, message: str):
    with pytest.raises(UsageError) as caught:
        parse_faults([text])
    assert message in str(caught.value)
    assert caught.value.fix.startswith("fault=")


def test_samples_on_the_link_carry_the_cause():
    endpoint = emulated("mock:?fault=overtemperature@0.05")
    endpoint.receive(0, wire(Arm(0, 1, 2000, 200_000)) + wire(CommandFrame(1, 5_000_000, 0)))
    frames = [f for f in Splitter().feed(endpoint.tick(100_000)) if isinstance(f, SampleFrame)]
    before = [s for s in frames if s.time_us < 50_000]
    after = frames[len(before) :]
    assert {(s.front_uV, s.flags, s.cause) for s in before} == {(5_000_000, 1, 0)}
    assert {(s.front_uV, s.flags, s.cause) for s in after} == {(0, 2, Cause.OVERTEMPERATURE)}
