"""A NaN never becomes volts: from a driver's sample, through controller and clip, to the motors."""

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
MEASURED_OR_NOT: list[dict[str, Any]] = [
    {"v_applied": (nan, nan)}, {"current": (nan, inf)}, {"v_applied": (inf, nan)},
]  # fmt: skip
V_MAX = PROFILE.motor.v_max
ANY = st.floats(allow_nan=True, allow_infinity=True)


def gives(bad: dict[str, Any], ks: range) -> ScriptedRig:
    return ScriptedRig(lambda k, s: replace(s, **bad) if k in ks else s)


def watched() -> dict[str, Any]:
    return {"monitors": monitors_for(PROFILE).each_period}


@pytest.mark.parametrize("bad", BAD, ids=str)
@pytest.mark.parametrize("ks", [range(40, 41), range(40, 10**6)], ids=["once", "from then on"])
def test_a_sample_that_is_no_number_ends_the_flight_with_a_ramp_from_the_last_volts(
    bad: dict[str, Any], ks: range
) -> None:
    rig = gives(bad, ks)
    outcome, sink = flown(rig, **watched())
    assert outcome.ending == "tripped"
    assert "the rig's driver gave a sample that cannot be used" in outcome.detail
    assert "a mistake in the driver" in outcome.advice()["likely_cause"]
    volts = [c.v_front for c in rig.commands[39:]]
    assert all(isfinite(v) for v in volts)
    assert volts == sorted(volts, reverse=True)
    assert ends_at_zero(rig)
    assert len([r for r in sink.rows if r.phase == RAMP_DOWN]) > 200, "every period is kept"


@pytest.mark.parametrize("bad", BAD, ids=str)
def test_a_bad_sample_in_the_landing_changes_no_volts(bad: dict[str, Any]) -> None:
    rig = gives(bad, range(150, 200))
    outcome, _ = flown(rig, **watched())
    assert outcome.ending != "error"
    volts = [c.v_front for c in rig.commands[100:]]
    assert volts == sorted(volts, reverse=True)
    assert ends_at_zero(rig)


@pytest.mark.parametrize("bad", BAD, ids=str)
def test_a_bad_first_sample_flies_nothing(bad: dict[str, Any]) -> None:
    rig = gives(bad, range(1))
    outcome, _ = flown(rig)
    assert (outcome.ending, rig.commands) == ("device", [])
    assert rig.stopped


@pytest.mark.parametrize("bad", MEASURED_OR_NOT, ids=str)
def test_a_voltage_or_current_that_is_not_measured_may_be_nan(bad: dict[str, Any]) -> None:
    outcome, _ = flown(gives(bad, range(10**6)))
    assert outcome.ending == "completed"


@pytest.mark.parametrize("bad", MEASURED_OR_NOT, ids=str)
def test_a_frozen_encoder_is_found_without_measured_voltages(bad: dict[str, Any]) -> None:
    outcome, _ = flown(gives(bad, range(10**6)), **watched())
    assert outcome.ending == "tripped"
    assert "the roll encoder's count stood at 313" in outcome.detail


@pytest.mark.parametrize("bad", BAD, ids=str)
def test_a_verb_that_only_reads_is_told_which_field_is_bad(bad: dict[str, Any]) -> None:
    sample = replace(Sample(0, 0.0, (0, 0, 0), (0.0, 0.0), (0.0, 0.0), Flags(0), 0.0), **bad)
    rig = StoppableRig(
        SimpleNamespace(read=lambda: sample),  # type: ignore[arg-type]
        SimpleNamespace(asked=None),  # type: ignore[arg-type]
    )
    with pytest.raises(DeviceError, match="cannot be used"):
        rig.read()


@given(st.lists(st.tuples(st.tuples(ANY, ANY, ANY), st.tuples(ANY, ANY, ANY)), max_size=30))
@example([((nan, nan, nan), (nan, nan, nan))] * 3)
@settings(deadline=None)
def test_whatever_the_angles_and_references_the_controller_gives_volts_within_the_limit(
    steps: list[tuple[Sequence[float], Sequence[float]]],
) -> None:
    controller = Controller.of(PROFILE)
    controller.reset((nan, inf, 0.0))
    for angle, reference in steps:
        asked, volts = controller.step(angle, reference, (nan, 0.0))
        for a, v in zip(asked, volts, strict=True):
            assert abs(v) <= V_MAX
            assert isfinite(a) or v == 0.0


@given(ANY, ANY)
@example(nan, 5.0)
@example(5.0, -inf)
def test_the_emulated_amplifier_stops_for_a_voltage_that_is_none(front: float, back: float) -> None:
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
