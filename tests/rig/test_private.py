"""Which rigs live inside the process that opens them, and are neither locked nor looked for."""

from __future__ import annotations

import pytest

from heli3dof.rig.drivers import is_private


@pytest.mark.parametrize(
    ("url", "private"),
    [
        ("mock:?speed=max", True),
        ("usb+mock:", True),
        ("usb://1209:0001/A", False),
        ("serial:///dev/ttyACM0", False),
        ("serial+socket://host:1", False),
        ("quanser://q8_usb/0", False),
    ],
)
def test_a_rig_is_private_where_every_opening_makes_one(url: str, private: bool):
    assert is_private(url) is private
