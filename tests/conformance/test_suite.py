"""The conformance suite detects faulty drivers: one fault each, and the case that fails."""

from __future__ import annotations

import math
import unittest
from collections.abc import Sequence
from dataclasses import replace

import pytest
from heli3dof_drivers.mock import MockDriver, MockRig

from heli3dof.errors import UsageError
from heli3dof.rig import drivers
from heli3dof.rig.conformance import CASES, NotConforming, conforms
from heli3dof.rig.conformance.__main__ import main
from heli3dof.rig.interface import Check, Command, Flags, Identity, Sample
from heli3dof.rig.profile import Profile
from heli3dof.rig.url import DeviceUrl

CASE = {case.name: case for case in CASES}


class Rig(MockRig):
    """A conforming rig; subclasses have one fault."""


class Driver(MockDriver):
    """A conforming driver; subclasses have one fault."""

    scheme = "spoilt"
    rig: type[Rig] = Rig

    def find(self) -> Sequence[str]:
        return ["spoilt:"]

    def open(self, url: DeviceUrl, profile: Profile) -> MockRig:
        from heli3dof_drivers.options import MockOptions

        return self.rig(profile, MockOptions.of(url))


class FindsAnotherScheme(Driver):
    def find(self) -> Sequence[str]:
        return ["mock:"]


class HidesAnOption(Driver):
    options = ("watchdog_s", "speed", "seed", "secret")

    def open(self, url: DeviceUrl, profile: Profile) -> MockRig:
        raise AssertionError


class ChecksWithoutFix(Driver):
    def examine(self, url: DeviceUrl) -> Sequence[Check]:
        return [Check("latency", "16 ms", False)]


class CanBeOpenedTwice(Driver):
    private_to_process = False


class DoesNotReportItsStop(Driver):
    def estop(self, url: DeviceUrl) -> str:
        return ""


class StopsMissingRigs(Driver):
    """Reports a stop for every URL."""

    private_to_process = False

    def estop(self, url: DeviceUrl) -> str:
        return "stopped"


class OnlyReportsItsStop(Driver):
    private_to_process = False

    def estop(self, url: DeviceUrl) -> str:
        return "stopped"


class OneFixedRig(Driver):
    """Its rig is still armed when it is opened again."""

    class rig(Rig):
        def close(self) -> None:
            self._open = False

    held: MockRig | None = None

    def open(self, url: DeviceUrl, profile: Profile) -> MockRig:
        if OneFixedRig.held is None or url.one("no_such_option"):
            OneFixedRig.held = super().open(url, profile)
        OneFixedRig.held._open = True
        return OneFixedRig.held


def spoilt(name: str, **methods: object) -> type[Driver]:
    """A driver whose rig has one fault."""
    return type(name, (Driver,), {"rig": type(name, (Rig,), methods)})


def _no_firmware(self: Rig) -> Identity:
    return replace(MockRig.identity.fget(self), firmware="")  # type: ignore[attr-defined]


def _other_counts(self: Rig) -> Identity:
    return replace(MockRig.identity.fget(self), counts_per_rev=(1, 2, 3))  # type: ignore[attr-defined]


def _armed_unasked(self: Rig, command: Command, due_s: float) -> Sample:
    if not self.device.enabled:
        self.device.arm()
    return MockRig.exchange(self, command, due_s)


def _reading_arms(self: Rig) -> Sample:
    self.device.arm()
    return MockRig.read(self)


def _arms_with_volts(self: Rig) -> Sample:
    return replace(MockRig.arm(self), v_applied=(1.0, 1.0))


def _one_behind(self: Rig, command: Command, due_s: float) -> Sample:
    sample = MockRig.exchange(self, command, due_s)
    return replace(sample, sequence=sample.sequence - 1)


def _wrong_volts(self: Rig, command: Command, due_s: float) -> Sample:
    return replace(MockRig.exchange(self, command, due_s), v_applied=(0.0, 0.0))


def _half_a_clock(self: Rig, command: Command, due_s: float) -> Sample:
    sample = MockRig.exchange(self, command, due_s)
    return replace(sample, device_time_s=sample.device_time_s / 2)


def _twice_a_clock(self: Rig, command: Command, due_s: float) -> Sample:
    sample = MockRig.exchange(self, command, due_s)
    return replace(sample, device_time_s=sample.device_time_s * 2)


def _silent_about_clipping(self: Rig, command: Command, due_s: float) -> Sample:
    sample = MockRig.exchange(self, command, due_s)
    return replace(sample, flags=sample.flags & ~Flags.SATURATED)


def _currents_backwards(self: Rig, command: Command, due_s: float) -> Sample:
    return replace(MockRig.exchange(self, command, due_s), current=(-1.0, -1.0))


def _motors_swapped(self: Rig, command: Command, due_s: float) -> Sample:
    swapped = Command(command.sequence, command.v_back, command.v_front)
    return MockRig.exchange(self, swapped, due_s)


def _deaf(self: Rig, reason: str) -> None:
    pass


def _takes_anything(self: Rig, command: Command, due_s: float) -> Sample:
    front = command.v_front if math.isfinite(command.v_front) else 24.0
    return MockRig.exchange(self, replace(command, v_front=front), due_s)


def _open_after_closing(self: Rig) -> None:
    self.device.disable()


def _forgives_silence(self: Rig, command: Command, due_s: float) -> Sample:
    if not self.device.stopped:
        self.device.latched, self.device._silent_s = False, 0.0
        self._last_s = due_s - 0.002
    return MockRig.exchange(self, command, due_s)


def _never_waits(self: Rig, command: Command, due_s: float) -> Sample:
    self.device.command(command.sequence, command.v_front, command.v_back)
    self.device.period()
    return self._sample()


def _arms_once(self: Rig) -> Sample:
    return self.read() if self.device.enabled else MockRig.arm(self)


def _stopped_for_good(self: Rig) -> Sample:
    stopped = self.device.stopped
    MockRig.arm(self)
    if stopped:
        self.device.stop()
    return self.read()


SPOILT = {
    FindsAnotherScheme: "find_returns_urls_of_the_drivers_scheme_within_a_second",
    ChecksWithoutFix: "a_failed_check_before_opening_names_its_fix",
    CanBeOpenedTwice: "opening_an_open_rig_fails_and_does_not_disturb_it",
    DoesNotReportItsStop: "the_drivers_estop_stops_a_rig_that_is_open_elsewhere",
    OnlyReportsItsStop: "the_drivers_estop_stops_a_rig_that_is_open_elsewhere",
    StopsMissingRigs: "the_drivers_estop_of_a_missing_rig_is_an_error",
    OneFixedRig: "a_closed_rig_can_be_opened_again_at_zero_volts",
    spoilt("NoFirmware", identity=property(_no_firmware)): (
        "the_identity_is_complete_and_agrees_with_the_profile"
    ),
    spoilt("OtherCounts", identity=property(_other_counts)): (
        "the_identity_is_complete_and_agrees_with_the_profile"
    ),
    spoilt("ArmedUnasked", exchange=_armed_unasked): "the_output_is_zero_before_arming",
    spoilt("ReadingArms", read=_reading_arms): ("reading_does_not_arm"),
    spoilt("DeafWhenRead", estop=_deaf): "reading_after_a_stop_returns_the_present_state",
    spoilt("ArmsWithVolts", arm=_arms_with_volts): "arming_enables_at_zero_volts",
    spoilt("OneBehind", exchange=_one_behind): (
        "a_sample_echoes_the_commands_sequence_and_voltages"
    ),
    spoilt("WrongVolts", exchange=_wrong_volts): (
        "a_sample_echoes_the_commands_sequence_and_voltages"
    ),
    spoilt("HalfAClock", exchange=_half_a_clock): (
        "the_devices_clock_advances_by_the_control_period"
    ),
    spoilt("TwiceAClock", exchange=_twice_a_clock): (
        "the_devices_clock_advances_by_the_control_period"
    ),
    spoilt("SilentAboutClipping", exchange=_silent_about_clipping): (
        "voltages_are_clipped_and_the_sample_is_flagged_saturated"
    ),
    spoilt("CurrentsBackwards", exchange=_currents_backwards): (
        "currents_have_the_voltages_signs_or_are_nan"
    ),
    spoilt("MotorsSwapped", exchange=_motors_swapped): (
        "equal_voltages_lift_the_body_and_a_larger_front_voltage_raises_the_front"
    ),
    spoilt("Deaf", estop=_deaf): ("an_emergency_stop_holds_until_arming_and_may_be_repeated"),
    spoilt("StoppedForGood", arm=_stopped_for_good): (
        "an_emergency_stop_before_arming_is_cleared_by_arming"
    ),
    spoilt("TakesAnything", exchange=_takes_anything): (
        "a_voltage_that_is_not_finite_never_reaches_the_motors"
    ),
    spoilt("OpenAfterClosing", close=_open_after_closing): "closing_is_idempotent_and_final",
    spoilt("ForgivesSilence", exchange=_forgives_silence): (
        "the_watchdog_latches_a_silent_host_until_it_arms"
    ),
    spoilt("NeverWaits", exchange=_never_waits): "skipped_periods_are_not_executed_in_a_burst",
    spoilt("CountsInWords", statistics={"lost": "some"}): (
        "link_statistics_are_a_dataclass_of_counts"
    ),
    spoilt("ArmsOnce", arm=_arms_once): "arming_while_armed_restarts_at_zero_volts",
}


def use(monkeypatch: pytest.MonkeyPatch, driver: type[Driver]) -> None:
    class Entry:
        value = "tests"
        module = "tests"
        name = "spoilt"

        @staticmethod
        def load() -> type[Driver]:
            return driver

    monkeypatch.setattr(drivers, "registered", lambda: {"spoilt": Entry()})
    OneFixedRig.held = None


def url_of(case: str) -> str:
    timed = (
        "the_watchdog_latches_a_silent_host_until_it_arms",
        "skipped_periods_are_not_executed_in_a_burst",
    )
    return "spoilt:?watchdog_s=0.3" if case in timed else "spoilt:?speed=max"


@pytest.mark.parametrize("case", CASES, ids=str)
def test_the_driver_without_a_fault_conforms(monkeypatch: pytest.MonkeyPatch, case):
    use(monkeypatch, Driver)
    conforms(case, url_of(case.name))


@pytest.mark.parametrize("driver", SPOILT, ids=lambda d: d.__name__)
def test_each_fault_fails_its_case(monkeypatch: pytest.MonkeyPatch, driver: type[Driver]):
    use(monkeypatch, driver)
    with pytest.raises(NotConforming) as caught:
        conforms(CASE[SPOILT[driver]], url_of(SPOILT[driver]))
    assert "found:" in caught.value.what
    assert caught.value.fix


def test_an_error_for_a_wrong_option_names_every_option(monkeypatch: pytest.MonkeyPatch):
    use(monkeypatch, HidesAnOption)

    def silent(url: DeviceUrl, known: Sequence[str]) -> None:
        raise UsageError(f"{url.text}: there is no such option.")

    monkeypatch.setattr(DeviceUrl, "check_options", silent)
    case = CASE["an_unknown_option_is_an_error_that_names_the_known_ones"]
    with pytest.raises(NotConforming, match="secret"):
        conforms(case, "spoilt:")


def test_every_case_can_fail():
    above = "an_unknown_option_is_an_error_that_names_the_known_ones"
    assert {case.name for case in CASES} == {*SPOILT.values(), above}


def test_a_real_rig_does_not_move_by_default(monkeypatch: pytest.MonkeyPatch):
    def real(self: Rig) -> Identity:
        return replace(MockRig.identity.fget(self), emulated=False)  # type: ignore[attr-defined]

    def armed(self: Rig) -> Sample:
        raise AssertionError("it was armed")

    use(monkeypatch, spoilt("Real", identity=property(real), arm=armed))
    skipped = 0
    for case in CASES:
        try:
            conforms(case, "spoilt:?speed=max")
        except unittest.SkipTest:
            skipped += 1
    assert 10 < skipped < len(CASES)


def _unmeasured(self: Rig, command: Command, due_s: float) -> Sample:
    sample = MockRig.exchange(self, command, due_s)
    return replace(sample, v_applied=(math.nan, math.nan))


def test_a_rig_that_does_not_measure_its_voltages_conforms(monkeypatch: pytest.MonkeyPatch):
    use(monkeypatch, spoilt("Unmeasured", exchange=_unmeasured))
    assert main(["spoilt:?speed=max"]) == 0


def test_the_command_prints_a_line_for_each_case_and_exits_6_on_a_failure(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    use(monkeypatch, Driver)
    assert main(["spoilt:?speed=max"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(CASES)
    skipped = [line for line in lines if ": skipped: " in line]
    assert sum(line.endswith(": holds") for line in lines) == len(CASES) - len(skipped)
    assert len(skipped) == 3
    assert "a virtual clock" in skipped[-1]
    use(monkeypatch, spoilt("Deaf", estop=_deaf))
    assert main(["spoilt:?speed=max"]) == 6
    assert "FAILS: zero volts after an emergency stop" in capsys.readouterr().out
    assert main(["spolt:"]) == 2
    assert "There is no driver for 'spolt:'" in capsys.readouterr().err


def _raises(self: Rig) -> Sample:
    raise KeyError("ticket")


def test_an_unexpected_exception_fails_its_case_and_the_others_run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    use(monkeypatch, spoilt("Raises", read=_raises))
    assert main(["spoilt:?speed=max"]) == 6
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(CASES)
    failed = next(line for line in lines if line.startswith("reading does not arm: "))
    assert "FAILS: the driver raised KeyError: 'ticket' (test_suite.py, line " in failed
    assert sum(line.endswith(": holds") for line in lines) > 10


def test_the_command_says_how_many_cases_need_moves(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def real(self: Rig) -> Identity:
        return replace(MockRig.identity.fget(self), emulated=False)  # type: ignore[attr-defined]

    use(monkeypatch, spoilt("Real", identity=property(real)))
    assert main(["spoilt:?speed=max"]) == 0
    *lines, last = capsys.readouterr().out.splitlines()
    skipped = sum(": skipped: moves a real rig" in line for line in lines)
    assert skipped > 10
    assert last.startswith(f"{skipped} cases skipped: ")
    assert "--moves" in last
    assert main(["spoilt:?speed=max", "--moves"]) == 0
    assert "--moves" not in capsys.readouterr().out
