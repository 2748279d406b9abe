"""The exact calls to the library, in order and with their arguments."""

from __future__ import annotations

from heli3dof.rig.interface import Command, Flags
from tests.clock import Clock

from .conftest import Open
from .stand_in import Laboratory

MOTORS, ENCODERS, ENABLE = [0, 1], [2, 1, 0], [0, 1]
FOREVER = 0xFFFFFFFF
ZERO = ("write_analog", MOTORS, 2, [0.0, 0.0])
DISABLE = ("write_digital", ENABLE, 2, [0, 0])


def since(lab: Laboratory) -> list[tuple[object, ...]]:
    """The calls since the last call of this function."""
    calls = list(lab.calls)
    lab.calls.clear()
    return calls


def test_opening_switches_the_outputs_off(lab: Laboratory, open_board: Open):
    open_board()
    assert since(lab) == [
        ("open", "q8_usb", "0"),
        ("watchdog_clear",),
        ZERO,
        ("set_analog_output_ranges", MOTORS, 2, [-10.0, -10.0], [10.0, 10.0]),
        ("set_digital_directions", None, 0, ENABLE, 2),
        DISABLE,
        ("set_encoder_quadrature_mode", ENCODERS, 3, [4, 4, 4]),
        ("get_integer_property", [10, 11], 2),
    ]


def test_counts_are_set_to_zero_on_request(lab: Laboratory, open_board: Open):
    open_board("quanser://q8_usb/0?counts=zero")
    assert ("set_encoder_counts", ENCODERS, 3, [0, 0, 0]) in lab.calls


def test_arming_sets_both_expiration_states_before_the_amplifier_is_enabled(
    lab: Laboratory, open_board: Open
):
    rig = open_board("quanser://q2_usb/0?watchdog_s=0.5")
    since(lab)
    rig.arm()
    assert since(lab) == [
        ("watchdog_clear",),
        ZERO,
        DISABLE,
        ("task_create_encoder_reader", 40, ENCODERS, 3),
        ("task_start", 0, 20.0, FOREVER),
        ("watchdog_set_analog_expiration_state", MOTORS, 2, [0.0, 0.0]),
        ("watchdog_set_digital_expiration_state", ENABLE, 2, [0, 0]),
        ("watchdog_start", 0.5),
        ("write_digital", ENABLE, 2, [1, 1]),
        ("task_read_encoder", 1),
    ]


def test_a_q8_board_takes_tristate_and_needs_the_state_of_every_output(
    lab: Laboratory, open_board: Open
):
    rig = open_board()
    rig.arm()
    every = list(range(8))
    watchdog = [c for c in lab.calls if "watchdog_s" in c[0] or c[0] == "get_integer_property"]
    assert watchdog[1:] == [
        ("watchdog_set_analog_expiration_state", MOTORS, 2, [0.0, 0.0]),
        ("watchdog_set_digital_expiration_state", ENABLE, 2, [0, 0]),
        ("watchdog_set_digital_expiration_state", ENABLE, 2, [2, 2]),
        ("watchdog_start", 0.5),
        ("get_integer_property", [20, 22], 2),
        ("watchdog_set_analog_expiration_state", every, 8, [0.0] * 8),
        ("watchdog_set_digital_expiration_state", every, 8, [0, 0, *[2] * 6]),
        ("watchdog_set_digital_expiration_state", every, 8, [2] * 8),
        ("watchdog_start", 0.5),
    ]


def test_a_period_reloads_writes_and_waits(lab: Laboratory, open_board: Open):
    rig = open_board()
    rig.arm()
    since(lab)
    for k in (1, 2):
        rig.exchange(Command(k, 6.0, -3.0), 0.0)
        assert since(lab) == [
            ("watchdog_reload",),
            ("write_analog", MOTORS, 2, [2.0, -1.0]),  # the amplifier's gain is 3
            ("task_read_encoder", 1),
        ]


def test_currents_are_read_where_they_are_wired(lab: Laboratory, open_board: Open):
    rig = open_board("quanser://q8_usb/0?watchdog_s=0.5&current=0,1")
    rig.arm()
    sample = rig.exchange(Command(1, 12.0, -24.0), 0.0)
    assert lab.calls[-1] == ("read_analog", [0, 1], 2)
    assert sample.current == (1.0, -4.0)


def test_a_stop_writes_zero_disables_and_never_reloads_the_watchdog_again(
    lab: Laboratory, open_board: Open
):
    rig = open_board()
    rig.arm()
    rig.exchange(Command(1, 6.0, 6.0), 0.0)
    since(lab)
    rig.estop("test")
    assert since(lab) == [ZERO, DISABLE]
    for k in range(2, 5):
        rig.exchange(Command(k, 6.0, 6.0), 0.0)
    assert since(lab) == [("task_read_encoder", 1)] * 3


def test_a_rig_that_was_never_armed_is_read_without_a_task(lab: Laboratory, open_board: Open):
    rig = open_board()
    since(lab)
    rig.read()
    assert since(lab) == [("read_encoder", ENCODERS, 3)]


def test_closing_switches_off_before_the_watchdog_ends(lab: Laboratory, open_board: Open):
    rig = open_board()
    rig.arm()
    since(lab)
    rig.close()
    rig.close()
    assert since(lab) == [
        ZERO,
        DISABLE,
        ("watchdog_stop",),
        ("task_stop",),
        ("task_delete",),
        ("close",),
    ]


def test_arming_while_armed_writes_zero_before_the_watchdog_is_stopped(
    lab: Laboratory, open_board: Open
):
    rig = open_board()
    rig.arm()
    rig.exchange(Command(1, 6.0, 6.0), 0.0)
    since(lab)
    rig.arm()
    assert since(lab)[:3] == [ZERO, DISABLE, ("watchdog_stop",)]


def test_closing_keeps_the_watchdog_of_a_board_that_refused_zero_volts(
    lab: Laboratory, open_board: Open
):
    rig = open_board()
    rig.arm()
    rig.exchange(Command(1, 6.0, 6.0), 0.0)
    lab.failing["write_analog"] = 14
    rig.close()
    assert "watchdog_stop" not in lab.names
    assert lab.names[-1] == "close"


def test_a_latched_board_is_zeroed_at_once_when_it_is_cleared(
    lab: Laboratory, open_board: Open, own_clock: Clock
):
    """Clearing restores the outputs of before: enabled, at the last volts."""
    rig = open_board("quanser://q8_usb/0?watchdog_s=0.2")
    rig.arm()
    rig.exchange(Command(1, 6.0, 6.0), 0.0)
    own_clock.sleep(0.4)
    assert rig.exchange(Command(2, 6.0, 6.0), 0.0).flags == Flags.LATCHED
    since(lab)
    assert rig.arm().flags == Flags.ENABLED
    assert since(lab)[:4] == [("watchdog_stop",), ("watchdog_clear",), ZERO, DISABLE]


def test_a_latched_board_stays_latched_when_it_is_closed(
    lab: Laboratory, open_board: Open, own_clock: Clock
):
    rig = open_board("quanser://q8_usb/0?watchdog_s=0.2")
    rig.arm()
    rig.exchange(Command(1, 6.0, 6.0), 0.0)
    own_clock.sleep(0.4)
    rig.exchange(Command(2, 6.0, 6.0), 0.0)
    since(lab)
    rig.close()
    assert since(lab) == [("watchdog_stop",), ("task_stop",), ("task_delete",), ("close",)]
    assert lab.boards["q8_usb", "0"].motor_volts() == (0.0, 0.0)


def test_opening_clears_and_zeroes_a_latched_board(
    lab: Laboratory, open_board: Open, own_clock: Clock
):
    board = lab.boards["q8_usb", "0"]
    board.analog, board.digital = {0: 2.0, 1: 2.0}, {0: 1, 1: 1}
    board.watch(0.001)
    own_clock.sleep(0.01)
    board.advance()
    assert board.expired
    open_board()
    assert not board.expired
    assert board.motor_volts() == (0.0, 0.0)


def test_the_disabling_level_follows_the_wiring(lab: Laboratory, open_board: Open):
    url = "quanser://qpid_e/0?watchdog_s=0.5&front=3&back=2&enable=4&enabled_by=low"
    rig = open_board(url + "&roll=5&pitch=6&yaw=7&gain=5")
    assert ("write_digital", [4], 1, [1]) in lab.calls
    rig.arm()
    assert ("watchdog_set_digital_expiration_state", [4], 1, [1]) in lab.calls
    assert lab.calls[-2] == ("write_digital", [4], 1, [0])


def test_without_enable_lines_no_digital_output_is_touched(lab: Laboratory, open_board: Open):
    rig = open_board("quanser://qpid_e/1?enable=none&watchdog_s=0.5")
    rig.arm()
    rig.exchange(Command(1, 3.0, 3.0), 0.0)
    rig.close()
    assert not [name for name in lab.names if "digital" in name]


def test_the_identity_of_a_board(open_board: Open):
    identity = open_board().identity
    assert identity.model == "Quanser q8_usb"
    assert identity.serial == "q8_usb-0"
    assert identity.firmware == "2.9"
    assert identity.protocol == "HIL 4.5.6"
    assert identity.timebase == "device"
    assert not identity.emulated


def test_a_voltage_that_is_not_finite_is_written_as_zero(lab: Laboratory, open_board: Open):
    rig = open_board()
    since(lab)
    rig._board.write_volts(float("nan"), 6.0)
    rig._board.write_volts(6.0, float("-inf"))
    assert since(lab) == [ZERO, ZERO]
