"""The options of a quanser: URL and their errors."""

from __future__ import annotations

import pytest
from heli3dof_drivers.quanser_hil.wiring import Wiring

from heli3dof.errors import UsageError
from heli3dof.rig.url import parse_url


def test_the_defaults_are_the_vendors_helicopter():
    wiring = Wiring.of(parse_url("quanser://q8_usb/0"))
    assert wiring == Wiring(board="q8_usb", number="0")
    assert wiring.motors == (0, 1)
    assert wiring.encoders == (2, 1, 0)  # its elevation, pitch and travel
    assert wiring.enable == (0, 1)
    assert wiring.gain == 3.0


def test_a_board_without_a_number_is_the_first_of_its_type():
    assert Wiring.of(parse_url("quanser://qpid_e")).number == "0"


def test_every_option_is_taken():
    url = (
        "quanser://qpid_e/1?front=2&back=3&roll=4&pitch=5&yaw=6&enable=7&enabled_by=low&gain=1"
        "&current=2,3&amps_per_V=0.5&watchdog_s=0.2&clock=1&counts=zero"
    )
    assert set(parse_url(url).options) == set(Wiring.names())
    wiring = Wiring.of(parse_url(url))
    assert (wiring.board, wiring.number) == ("qpid_e", "1")
    assert (wiring.motors, wiring.encoders) == ((2, 3), (4, 5, 6))
    assert (wiring.enable, wiring.enable_level, wiring.current) == ((7,), 0, (2, 3))
    assert (wiring.gain, wiring.amps_per_V, wiring.watchdog_s) == (1.0, 0.5, 0.2)
    assert (wiring.clock, wiring.counts) == (1, "zero")


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("quanser:", "does not name a board"),
        ("quanser://q8_usb/", "does not name a board"),
        ("quanser://q8_usb/0?front=x", "front=x is not a channel number"),
        ("quanser://q8_usb/0?enable=0,-1", "enable=0,-1 is not a channel number"),
        ("quanser://q8_usb/0?roll=0", "roll, pitch, yaw are 0, 1, 0: one channel twice"),
        ("quanser://q8_usb/0?back=0", "front, back are 0, 0: one channel twice"),
        ("quanser://q8_usb/0?gain=0", "gain=0 is not a number from 0.01 to 100"),
        ("quanser://q8_usb/0?current=1", "current=1 is not two inputs"),
        ("quanser://q8_usb/0?enabled_by=hgih", "is not one of high, low"),
        ("quanser://q8_usb/0?counts=no", "is not one of keep, zero"),
        ("quanser://q8_usb/0?watchdog_s=2", "not a number from 0.001 to 1"),
        ("quanser://q8_usb/0?wachdog_s=1", "did you mean 'watchdog_s'"),
    ],
)
def test_a_wrong_option_is_named(url: str, message: str):
    with pytest.raises(UsageError) as caught:
        Wiring.of(parse_url(url))
    assert message in str(caught.value)
    assert caught.value.fix
