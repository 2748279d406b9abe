"""Each failure of a board has its own message, and the motors stop in each."""

from __future__ import annotations

import sys
from types import ModuleType

import pytest
from heli3dof_drivers.quanser_hil import QuanserDriver
from heli3dof_drivers.quanser_hil.board import library
from heli3dof_drivers.quanser_hil.error_codes import Qerr, explain

from heli3dof.errors import DeviceError, UsageError
from heli3dof.rig.interface import Command, Flags
from heli3dof.rig.url import parse_url
from tests.clock import Clock

from .board import PROFILE, Board
from .conftest import Open
from .stand_in import HILError, Laboratory

URL = "quanser://q8_usb/0?watchdog_s=0.5"

MESSAGES = {
    Qerr.BOARD_NOT_FOUND: "there is no such board",
    Qerr.UNRECOGNIZED_BOARD_TYPE: "does not know this board name",
    Qerr.BOARD_IN_USE: f"{URL} is in use",
    Qerr.NO_PERMISSION: "no permission",
    Qerr.UNABLE_TO_OPEN_DRIVER: "the board's driver does not load",
    Qerr.MISSING_LICENSE_FILE: "no valid licence",
    Qerr.BUFFER_OVERFLOW: "samples were lost",
    Qerr.NO_SUCH_DEVICE: "was lost while running",
    Qerr.HARDWARE_CLOCK_IN_USE: "the board's clock is in use",
    Qerr.CLOCK_FREQUENCY_TOO_HIGH: "cannot run at the profile's rate",
    Qerr.INVALID_ENCODER_INPUT_CHANNEL: "no such channel",
    Qerr.DIGITAL_EXPIRATION_NOT_SUPPORTED: "cannot switch the outputs off",
    Qerr.Q8_SERIES_EXPIRATIONS_NOT_CONFIGURED: "needs the state of every output",
    Qerr.FUNCTION_NOT_SUPPORTED: "the vendor's words for 94",
}


@pytest.mark.parametrize("code", MESSAGES, ids=lambda c: c.name)
def test_each_error_of_the_library_has_its_own_message(code: Qerr):
    error = explain(HILError(-code), URL, "running")
    assert MESSAGES[code] in error.what
    assert error.what.startswith(URL)
    assert error.cause
    assert error.fix
    assert [c for c, text in MESSAGES.items() if text in error.what] == [code]


def test_a_missing_package_and_a_missing_library_have_their_own_messages(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setitem(sys.modules, "quanser", None)
    with pytest.raises(DeviceError, match=r"quanser\.hardware is missing"):
        library()

    def load(name: str) -> ModuleType:
        raise OSError("cannot load library 'hil'")

    monkeypatch.setattr("importlib.import_module", load)
    with pytest.raises(DeviceError, match="the HIL library does not load"):
        library()


def test_without_the_library_examine_names_what_to_install(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "quanser", None)
    (check,) = QuanserDriver().examine(parse_url(URL))
    assert check.good is False
    assert "quanser_sdk" in check.fix


def flown(open_board: Open, url: str = URL):
    rig = open_board(url)
    rig.arm()
    rig.exchange(Command(1, 6.0, 6.0), 0.0)
    return rig


def q8(lab: Laboratory) -> Board:
    return lab.boards["q8_usb", "0"]


@pytest.mark.parametrize("call", ["write_analog", "watchdog_reload", "task_read_encoder"])
def test_a_failing_call_ends_the_run_with_the_motors_off(
    lab: Laboratory, open_board: Open, call: str
):
    rig = flown(open_board)
    lab.failing[call] = Qerr.TIMED_OUT
    with pytest.raises(DeviceError, match="was lost while running"):
        rig.exchange(Command(2, 6.0, 6.0), 0.0)
    assert q8(lab).motor_volts() == (0.0, 0.0)
    lab.failing.clear()
    assert rig.exchange(Command(3, 6.0, 6.0), 0.0).flags == Flags.ESTOP


def test_lost_samples_end_the_run_and_arming_begins_with_an_empty_buffer(
    lab: Laboratory, open_board: Open
):
    rig = flown(open_board)
    before = rig.read().device_time_s
    q8(lab).tasks[0].overflowed = True
    with pytest.raises(DeviceError, match="samples were lost"):
        rig.exchange(Command(2, 6.0, 6.0), 0.0)
    assert q8(lab).motor_volts() == (0.0, 0.0)
    assert rig.arm().device_time_s > before
    assert rig.exchange(Command(3, 6.0, 6.0), 0.0).v_applied == (6.0, 6.0)


def test_lost_samples_of_a_rig_at_rest_are_no_error(lab: Laboratory, open_board: Open):
    rig = flown(open_board)
    rig.estop("test")
    q8(lab).tasks[0].overflowed = True
    assert rig.read().flags == Flags.ESTOP


def test_the_boards_watchdog_stops_a_silent_host(
    lab: Laboratory, open_board: Open, own_clock: Clock
):
    flown(open_board, "quanser://q8_usb/0?watchdog_s=0.2")
    assert q8(lab).motor_volts() == (6.0, 6.0)
    own_clock.sleep(0.3)
    q8(lab).advance()
    assert q8(lab).expired
    assert q8(lab).motor_volts() == (0.0, 0.0)


def test_a_write_refused_after_expiry_latches_the_rig(lab: Laboratory, open_board: Open):
    rig = flown(open_board)
    q8(lab).expired = True
    q8(lab).feed = lambda: True  # type: ignore[method-assign]  # it expired just after the reload
    lab.failing["write_analog"] = Qerr.FUNCTION_NOT_SUPPORTED
    assert rig.exchange(Command(2, 6.0, 6.0), 0.0).flags == Flags.LATCHED
    assert rig.device_cause == "WATCHDOG"


def test_an_unplugged_cable_ends_the_run_and_closing_succeeds(lab: Laboratory, open_board: Open):
    rig = flown(open_board)
    q8(lab).plugged = False
    with pytest.raises(DeviceError, match="was lost while running"):
        rig.exchange(Command(2, 6.0, 6.0), 0.0)
    with pytest.raises(DeviceError, match="did not accept the stop"):
        rig.estop("test")
    rig.close()


def test_a_task_ended_by_another_program_ends_the_run(lab: Laboratory, open_board: Open):
    rig = flown(open_board)
    q8(lab).tasks[0].buffer.clear()  # its earlier samples could still be read
    q8(lab).tasks.clear()
    with pytest.raises(DeviceError, match="encoder task has ended"):
        rig.exchange(Command(2, 6.0, 6.0), 0.0)
    assert q8(lab).motor_volts() == (0.0, 0.0)


@pytest.mark.parametrize(
    ("call", "code"),
    [
        ("watchdog_set_analog_expiration_state", Qerr.ANALOG_EXPIRATION_NOT_SUPPORTED),
        ("watchdog_set_digital_expiration_state", Qerr.DIGITAL_EXPIRATION_NOT_SUPPORTED),
        ("watchdog_start", Qerr.WATCHDOG_START_NOT_SUPPORTED),
        ("watchdog_start", Qerr.Q8_SERIES_EXPIRATIONS_NOT_CONFIGURED),
    ],
)
def test_a_board_whose_watchdog_cannot_stop_it_is_never_enabled(
    lab: Laboratory, open_board: Open, call: str, code: int
):
    rig = open_board(URL)
    lab.failing[call] = code
    with pytest.raises(DeviceError, match="cannot be used"):
        rig.arm()
    assert not [c for c in lab.calls if c[0] == "write_digital" and any(c[3])]


def test_a_board_with_an_unknown_number_of_outputs_is_not_armed(lab: Laboratory, open_board: Open):
    lab.failing["get_integer_property"] = Qerr.FUNCTION_NOT_SUPPORTED
    rig = open_board(URL)
    assert rig.identity.firmware == "unknown"
    with pytest.raises(DeviceError, match="needs the state of every output"):
        rig.arm()
    assert q8(lab).motor_volts() == (0.0, 0.0)


def test_a_board_without_a_watchdog_can_be_opened_and_read(lab: Laboratory, open_board: Open):
    for call, code in (("watchdog_clear", 599), ("watchdog_start", 595), ("watchdog_stop", 596)):
        lab.failing[call] = code
    assert open_board(URL).read().flags == Flags(0)


def test_a_board_that_cannot_be_switched_off_is_closed_again(lab: Laboratory, open_board: Open):
    lab.failing["write_digital"] = Qerr.INVALID_DIGITAL_OUTPUT_CHANNEL
    with pytest.raises(DeviceError, match="no such channel"):
        open_board(URL)
    assert q8(lab).holders == 0


def test_estop_disables_a_board_that_another_program_runs(
    lab: Laboratory, open_board: Open, driver: QuanserDriver
):
    q8(lab).shared = True
    rig = flown(open_board)
    assert "disabled" in driver.estop(parse_url(URL))
    for k in range(2, 6):
        rig.exchange(Command(k, 6.0, 6.0), 0.0)  # the other program continues to write
        assert q8(lab).motor_volts() == (0.0, 0.0)


def test_estop_is_an_error_where_the_board_refuses_a_second_program(
    open_board: Open, driver: QuanserDriver
):
    flown(open_board)
    with pytest.raises(DeviceError, match="is in use") as caught:
        driver.estop(parse_url(URL))
    assert "red button" in caught.value.fix


def test_estop_after_the_watchdog_expired_has_nothing_to_do(lab: Laboratory, driver: QuanserDriver):
    q8(lab).expired = True
    lab.failing["write_digital"] = Qerr.FUNCTION_NOT_SUPPORTED
    assert "watchdog" in driver.estop(parse_url(URL))
    q8(lab).expired = False
    with pytest.raises(DeviceError):
        driver.estop(parse_url(URL))


def test_estop_without_an_enable_line_is_an_error(driver: QuanserDriver):
    with pytest.raises(DeviceError, match="but may not stay"):
        driver.estop(parse_url("quanser://qpid_e/1?enable=none"))


def test_a_watchdog_shorter_than_two_periods_is_refused(open_board: Open):
    with pytest.raises(UsageError, match="shorter than two control periods"):
        open_board("quanser://q8_usb/0?watchdog_s=0.003", PROFILE)


def test_an_amplifier_that_the_board_cannot_drive_to_its_limit_has_a_lower_one(open_board: Open):
    rig = open_board("quanser://q8_usb/0?gain=1&watchdog_s=0.5")
    assert rig.identity.v_max == 10.0
    rig.arm()
    sample = rig.exchange(Command(1, 12.0, 1.0), 0.0)
    assert sample.v_applied == (10.0, 1.0)
    assert sample.flags == Flags.ENABLED | Flags.SATURATED
