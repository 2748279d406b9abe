"""A NaN in a driver's sample, a reference or a command never reaches the motors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf, isfinite, nan
from types import SimpleNamespace
from typing import Any

import pytest
from heli3dof_drivers.emulator.device import Device
from heli3dof_drivers.link.frames import LONGEST
from hypothesis import example, given, settings
from hypothesis import strategies as st

from heli3dof.errors import DeviceError
from heli3dof.experiment.safety_monitors import monitors_for
from heli3dof.model.control.controller import Controller
from heli3dof.recording.row import RAMP_DOWN
from heli3dof.rig.interface import Flags, Sample
from heli3dof.rig.session.stoppable_rig import StoppableRig
from tests.drivers.emulator.still import StillPlant
from tests.experiment.control_loop.test_loop import PROFILE, ScriptedRig, ends_at_zero, flown

BAD: list[dict[str, Any]] = [
    {"counts": (nan, 0, 0)}, {"counts": (313, nan, 0)}, {"counts": (313, 0, inf)},
    {"counts": (313.5, 0, 0)}, {"counts": (None, 0, 0)}, {"counts": ()},
    {"device_time_s": nan}, {"host_time_s": nan}, {"host_time_s": None},
    {"sequence": nan}, {"flags": nan}, {"flags": None},
]  # fmt: skip
FLOWN = [BAD[i] for i in (0, 4, 7, 11)]
"""One bad sample for each field that the loop uses; without a flight, all are tested."""
MEASURED_OR_NOT: list[dict[str, Any]] = [
    {"v_applied": (nan, nan)}, {"current": (nan, inf)}, {"v_applied": (inf, nan)},
]  # fmt: skip
V_MAX = PROFILE.motor.v_max
ANY = st.floats(allow_nan=True, allow_infinity=True)


def faulty(bad: dict[str, Any], ks: range) -> ScriptedRig:
    return ScriptedRig(lambda k, s: replace(s, **bad) if k in ks else s)


def monitored() -> dict[str, Any]:
    return {"monitors": monitors_for(PROFILE)}


@pytest.mark.parametrize("bad", FLOWN, ids=str)
@pytest.mark.parametrize("ks", [range(40, 41), range(40, 10**6)], ids=["once", "from then on"])
def test_an_unusable_sample_ends_the_flight_with_a_ramp_from_the_last_volts(
    bad: dict[str, Any], ks: range
) -> None:
    rig = faulty(bad, ks)
    outcome, sink = flown(rig, **monitored())
    assert outcome.ending == "tripped"
    assert "the rig's driver gave a sample that cannot be used" in outcome.detail
    assert "a mistake in the driver" in outcome.advice()["likely_cause"]
    volts = [c.v_front for c in rig.commands[39:]]
    assert all(isfinite(v) for v in volts)
    assert volts == sorted(volts, reverse=True)
    assert ends_at_zero(rig)
    assert len([r for r in sink.rows if r.phase == RAMP_DOWN]) > 200, "every period is recorded"


@pytest.mark.parametrize("bad", FLOWN, ids=str)
def test_a_bad_sample_in_the_ramp_does_not_change_the_volts(bad: dict[str, Any]) -> None:
    rig = faulty(bad, range(150, 200))
    outcome, _ = flown(rig, **monitored())
    assert outcome.ending != "error"
    volts = [c.v_front for c in rig.commands[100:]]
    assert volts == sorted(volts, reverse=True)
    assert ends_at_zero(rig)


@pytest.mark.parametrize("bad", FLOWN, ids=str)
def test_a_bad_first_sample_prevents_the_flight(bad: dict[str, Any]) -> None:
    rig = faulty(bad, range(1))
    outcome, _ = flown(rig)
    assert (outcome.ending, rig.commands) == ("device", [])
    assert rig.stopped


@pytest.mark.parametrize("bad", MEASURED_OR_NOT, ids=str)
def test_a_voltage_or_current_that_is_not_measured_may_be_nan(bad: dict[str, Any]) -> None:
    outcome, _ = flown(faulty(bad, range(10**6)))
    assert outcome.ending == "completed"


@pytest.mark.parametrize("bad", MEASURED_OR_NOT, ids=str)
def test_a_frozen_encoder_is_reported_without_measured_voltages(bad: dict[str, Any]) -> None:
    outcome, _ = flown(faulty(bad, range(10**6)), **monitored())
    assert outcome.ending == "tripped"
    assert "the roll encoder's count stood at 313" in outcome.detail


@pytest.mark.parametrize("bad", BAD, ids=str)
def test_a_bad_sample_without_a_flight_raises_and_names_the_field(bad: dict[str, Any]) -> None:
    sample = replace(Sample(0, 0.0, (0, 0, 0), (0.0, 0.0), (0.0, 0.0), Flags(0), 0.0), **bad)
    rig = StoppableRig(
        SimpleNamespace(read=lambda: sample),  # type: ignore[arg-type]
        SimpleNamespace(stop_reason=None),  # type: ignore[arg-type]
    )
    with pytest.raises(DeviceError, match="cannot be used"):
        rig.read()


@given(st.lists(st.tuples(st.tuples(ANY, ANY, ANY), st.tuples(ANY, ANY, ANY)), max_size=30))
@example([((nan, nan, nan), (nan, nan, nan))] * 3)
@settings(deadline=None)
def test_the_controller_gives_volts_within_the_limit_for_any_input(
    steps: list[tuple[Sequence[float], Sequence[float]]],
) -> None:
    controller = Controller.of(PROFILE)
    controller.reset((nan, inf, 0.0))
    for angle, reference in steps:
        command, volts = controller.step(angle, reference, (nan, 0.0))
        for a, v in zip(command, volts, strict=True):
            assert abs(v) <= V_MAX
            assert isfinite(a) or v == 0.0


@given(ANY, ANY)
@example(nan, 5.0)
@example(5.0, -inf)
def test_the_emulated_amplifier_stops_on_a_voltage_of_nan_or_inf(front: float, back: float) -> None:
    device = Device(StillPlant(), v_max=24.0)  # type: ignore[arg-type]
    device.arm()
    device.command(1, front, back)
    if isfinite(front) and isfinite(back):
        assert device.v == (max(-24.0, min(24.0, front)), max(-24.0, min(24.0, back)))
    else:
        assert device.v == (0.0, 0.0)
        assert device.flags == Flags.ESTOP


def test_no_frame_can_hold_a_nan() -> None:
    from heli3dof_drivers.link.frames import CommandFrame, SampleFrame

    for kind in (CommandFrame, SampleFrame):
        assert not set(kind.BODY.format) & set("efd"), "whole numbers only"
        assert kind.BODY.size < LONGEST
