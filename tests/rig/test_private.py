"""Rigs that are private to the process that opens them."""

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
def test_only_emulated_rigs_inside_the_process_are_private(url: str, private: bool):
    assert is_private(url) is private
