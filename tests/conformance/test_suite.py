"""The conformance suite can fail: drivers that err in one way each, and the case that sees it."""

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
    """A rig that conforms, to be spoilt."""


class Driver(MockDriver):
    """A driver that conforms, to be spoilt."""

    scheme = "spoilt"
    rig: type[Rig] = Rig

    def find(self) -> Sequence[str]:
        return ["spoilt:"]

    def open(self, url: DeviceUrl, profile: Profile) -> MockRig:
        from heli3dof_drivers.options import MockOptions

        return self.rig(profile, MockOptions.of(url))


class NamesAnotherScheme(Driver):
    def find(self) -> Sequence[str]:
        return ["mock:"]


class KeepsItsOptionsToItself(Driver):
    options = ("watchdog_s", "speed", "seed", "secret")

    def open(self, url: DeviceUrl, profile: Profile) -> MockRig:
        raise AssertionError


class ComplainsWithoutHelp(Driver):
    def examine(self, url: DeviceUrl) -> Sequence[Check]:
        return [Check("latency", "16 ms", False)]


class CanBeOpenedTwice(Driver):
    private = False


class SaysNothingOfItsStop(Driver):
    def estop(self, url: DeviceUrl) -> str:
        return ""


class StopsNobody(Driver):
    """Whatever the URL says, there is something that it stops."""

    private = False

    def estop(self, url: DeviceUrl) -> str:
        return "stopped"


class PretendsToStop(Driver):
    private = False

    def estop(self, url: DeviceUrl) -> str:
        return "stopped, they say"


class OneFixedRig(Driver):
    """A rig that outlives its closing: it is still armed when it is opened again."""

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
    """A driver whose rig does one thing wrong."""
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
    NamesAnotherScheme: "a_driver_finds_its_rigs_in_no_time_by_urls_of_its_scheme",
    ComplainsWithoutHelp: "what_is_examined_before_opening_says_what_mends_it",
    CanBeOpenedTwice: "a_rig_that_is_open_is_busy_and_goes_on_undisturbed",
    SaysNothingOfItsStop: "the_drivers_stop_reaches_a_rig_that_another_holds",
    PretendsToStop: "the_drivers_stop_reaches_a_rig_that_another_holds",
    StopsNobody: "a_stop_of_a_rig_that_is_not_there_is_an_error",
    OneFixedRig: "a_closed_rig_can_be_opened_again_and_is_at_rest",
    spoilt("NoFirmware", identity=property(_no_firmware)): (
        "the_identity_is_complete_and_fits_the_profile"
    ),
    spoilt("OtherCounts", identity=property(_other_counts)): (
        "the_identity_is_complete_and_fits_the_profile"
    ),
    spoilt("ArmedUnasked", exchange=_armed_unasked): "before_arming_no_volt_gets_out",
    spoilt("ReadingArms", read=_reading_arms): (
        "reading_shows_a_rig_that_is_not_armed_and_leaves_it_so"
    ),
    spoilt("DeafWhenRead", estop=_deaf): "reading_after_a_flight_shows_where_the_rig_is",
    spoilt("ArmsWithVolts", arm=_arms_with_volts): "arming_enables_at_zero_volts",
    spoilt("OneBehind", exchange=_one_behind): (
        "a_sample_echoes_the_commands_sequence_and_its_volts"
    ),
    spoilt("WrongVolts", exchange=_wrong_volts): (
        "a_sample_echoes_the_commands_sequence_and_its_volts"
    ),
    spoilt("HalfAClock", exchange=_half_a_clock): (
        "the_devices_clock_advances_by_the_control_period"
    ),
    spoilt("TwiceAClock", exchange=_twice_a_clock): (
        "the_devices_clock_advances_by_the_control_period"
    ),
    spoilt("SilentAboutClipping", exchange=_silent_about_clipping): (
        "volts_stay_within_the_limit_and_the_sample_owns_up_to_it"
    ),
    spoilt("CurrentsBackwards", exchange=_currents_backwards): (
        "currents_are_numbers_of_the_voltages_sign_or_nan"
    ),
    spoilt("MotorsSwapped", exchange=_motors_swapped): (
        "equal_volts_lift_the_body_and_more_in_front_raises_the_front"
    ),
    spoilt("Deaf", estop=_deaf): (
        "an_emergency_stop_is_zero_volts_until_armed_however_often_it_is_called"
    ),
    spoilt("StoppedForGood", arm=_stopped_for_good): (
        "an_emergency_stop_is_heard_before_arming_too"
    ),
    spoilt("TakesAnything", exchange=_takes_anything): (
        "a_voltage_that_is_not_a_number_never_reaches_the_motors"
    ),
    spoilt("OpenAfterClosing", close=_open_after_closing): "closing_is_idempotent_and_final",
    spoilt("ForgivesSilence", exchange=_forgives_silence): (
        "a_silent_host_is_latched_out_until_it_arms_again"
    ),
    spoilt("NeverWaits", exchange=_never_waits): "a_host_that_was_away_flies_no_burst",
    spoilt("CountsInWords", statistics={"lost": "some"}): (
        "what_a_rig_counts_are_numbers_that_recordings_can_keep"
    ),
    spoilt("ArmsOnce", arm=_arms_once): "arming_while_armed_starts_again_at_zero_volts",
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
        "a_silent_host_is_latched_out_until_it_arms_again",
        "a_host_that_was_away_flies_no_burst",
    )
    return "spoilt:?watchdog_s=0.3" if case in timed else "spoilt:?speed=max"


@pytest.mark.parametrize("case", CASES, ids=str)
def test_the_driver_that_is_spoilt_below_conforms(monkeypatch: pytest.MonkeyPatch, case):
    use(monkeypatch, Driver)
    conforms(case, url_of(case.name))


@pytest.mark.parametrize("driver", SPOILT, ids=lambda d: d.__name__)
def test_what_a_driver_does_wrong_is_seen_and_named(
    monkeypatch: pytest.MonkeyPatch, driver: type[Driver]
):
    use(monkeypatch, driver)
    with pytest.raises(NotConforming) as caught:
        conforms(CASE[SPOILT[driver]], url_of(SPOILT[driver]))
    assert "found:" in caught.value.what
    assert caught.value.fix


def test_an_error_for_a_wrong_option_names_every_option(monkeypatch: pytest.MonkeyPatch):
    use(monkeypatch, KeepsItsOptionsToItself)

    def forgetful(url: DeviceUrl, known: Sequence[str]) -> None:
        raise UsageError(f"{url.text}: there is no such option.")

    monkeypatch.setattr(DeviceUrl, "check_options", forgetful)
    case = CASE["an_option_that_it_does_not_know_is_an_error_that_names_those_it_knows"]
    with pytest.raises(NotConforming, match="secret"):
        conforms(case, "spoilt:")


def test_every_case_is_seen_to_fail():
    above = "an_option_that_it_does_not_know_is_an_error_that_names_those_it_knows"
    assert {case.name for case in CASES} == {*SPOILT.values(), above}


def test_a_real_rig_is_not_moved_unless_that_is_asked_for(monkeypatch: pytest.MonkeyPatch):
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


def test_at_the_bench_each_case_has_a_line_and_the_exit_code_says_whether_all_hold(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    use(monkeypatch, Driver)
    assert main(["spoilt:?speed=max"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(CASES)
    left_out = [line for line in lines if ": left out: " in line]
    assert sum(line.endswith(": holds") for line in lines) == len(CASES) - len(left_out)
    assert len(left_out) == 3
    assert "a virtual clock" in left_out[-1]
    use(monkeypatch, spoilt("Deaf", estop=_deaf))
    assert main(["spoilt:?speed=max"]) == 6
    assert "DOES NOT HOLD: zero volts after an emergency stop" in capsys.readouterr().out
    assert main(["spolt:"]) == 2
    assert "There is no driver for 'spolt:'" in capsys.readouterr().err
