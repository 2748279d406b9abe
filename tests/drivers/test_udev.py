"""The udev rule that ships: every line is valid, and no device gets mode 0666."""

from __future__ import annotations

import re

import pytest
from heli3dof_drivers import udev
from heli3dof_drivers.emulator.usb_function import PRODUCT, VENDOR

PAIR = re.compile(r'(\w+(?:\{[\w/]+\})?)(==|!=|\+=|=)"([^"]*)"')
LINES = [
    line
    for line in udev.RULES.read_text(encoding="utf-8").splitlines()
    if line and not line.startswith("#")
]


@pytest.mark.parametrize("line", LINES)
def test_a_line_is_matches_then_assignments_and_nothing_else(line: str):
    pairs = [PAIR.fullmatch(part.strip()) for part in line.split(",")]
    assert all(pairs), line
    signs = [p[2] for p in pairs if p]
    matches = [s for s in signs if s in ("==", "!=")]
    assert matches == signs[: len(matches)]  # a match after an assignment is a typing error
    assert len(signs) > len(matches)
    assert {v for k, _, v in (p.groups() for p in pairs if p) if k == "MODE"} <= {"0660"}


def rules_for(**device: str) -> str:
    """The rules' assignments for a device with these properties, as text."""
    done = []
    for line in LINES:
        pairs = [p.groups() for p in PAIR.finditer(line)]
        wanted = {k: v for k, s, v in pairs if s == "=="}
        device_ = {k.replace("_of_", "{").replace("_end", "}"): v for k, v in device.items()}
        if all(re.fullmatch(v.replace("*", ".*"), device_.get(k, "")) for k, v in wanted.items()):
            done += [f"{k}{s}{v}" for k, s, v in pairs if s != "=="]
    return " ".join(done)


def test_the_user_at_the_machine_may_open_a_usb_rig():
    usb = {
        "SUBSYSTEM": "usb",
        "ENV_of_DEVTYPE_end": "usb_device",
        "ATTR_of_idVendor_end": f"{VENDOR:04x}",
        "ATTR_of_idProduct_end": f"{PRODUCT:04x}",
    }
    assert "GROUP=dialout MODE=0660 TAG+=uaccess" in rules_for(**usb)
    assert rules_for(**{**usb, "ATTR_of_idProduct_end": "0002"}) == ""


@pytest.mark.parametrize("port", ["ttyACM0", "ttyUSB11"])
def test_the_user_at_the_machine_may_open_a_serial_rig(port: str):
    assert rules_for(SUBSYSTEM="tty", KERNEL=port) == "TAG+=uaccess"
    assert rules_for(SUBSYSTEM="tty", KERNEL="ttyS0") == ""


def test_an_ftdi_adapter_gets_the_shortest_latency_timer():
    done = rules_for(ACTION="add", SUBSYSTEM="usb-serial", DRIVER="ftdi_sio")
    assert done == "ATTR{latency_timer}=1"


def test_the_rule_runs_before_the_one_that_reads_the_tag():
    assert udev.RULES.name < "73-seat-late.rules"


def test_the_command_installs_and_applies_this_file():
    command = udev.install_command()
    assert f"cp '{udev.RULES}' /etc/udev/rules.d/" in command
    assert command.index("--reload") < command.index("udevadm trigger")


def test_the_rigs_usb_numbers_are_read_from_the_rule():
    assert udev.known_ids() == {(VENDOR, PRODUCT)}


def test_a_number_that_a_lab_added_to_its_rule_is_known_too(monkeypatch, tmp_path):
    installed = tmp_path / "rule"
    line = 'SUBSYSTEM=="usb", ATTR{idVendor}=="16c0", ATTR{idProduct}=="05dc", MODE="0660"'
    installed.write_text(f"{line}\n# {line.replace('16c0', 'dead')}\n")
    monkeypatch.setattr(udev, "INSTALLED", installed)
    assert udev.known_ids() == {(VENDOR, PRODUCT), (0x16C0, 0x05DC)}
