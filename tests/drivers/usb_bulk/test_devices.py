"""A URL selects one rig; the errors where it selects none, several, or one in use."""

from __future__ import annotations

from pathlib import Path

import pytest
from heli3dof_drivers.emulator.transport_usb import BusFault
from heli3dof_drivers.emulator.usb_mock import UsbMockDriver
from heli3dof_drivers.options import RigOptions
from heli3dof_drivers.udev import RULES
from heli3dof_drivers.usb_bulk import UsbDriver, devices, errors

from heli3dof.errors import DeviceError, UsageError
from heli3dof.rig.url import parse_url
from tests.paths import ROOT

from .laboratory import PROFILE, Lab


def refused(lab: Lab, url: str) -> str:
    with pytest.raises(DeviceError) as caught:
        lab.open(url)
    assert caught.value.cause
    assert caught.value.fix
    return str(caught.value)


def test_every_rig_on_the_bus_is_found_by_number_and_serial(lab: Lab):
    assert lab.driver.find() == []
    lab.plug(1)
    lab.plug(2)
    assert lab.driver.find() == ["usb://1209:0001/mock-1", "usb://1209:0001/mock-2"]
    for url in lab.driver.find():
        assert lab.open(url).identity.serial == url.rpartition("/")[2]


@pytest.mark.parametrize(
    "url",
    ["usb:", "usb://", "usb://1209:0001", "usb://1209:1/mock-7", "usb:///mock-7", "usb://mock-7"],
)
def test_the_place_may_be_omitted_where_one_rig_is_on_the_bus(lab: Lab, url: str):
    lab.plug(7)
    assert lab.open(url).identity.serial == "mock-7"


def test_an_ambiguous_url_lists_the_rigs_that_fit(lab: Lab):
    lab.plug(1)
    lab.plug(2)
    message = refused(lab, "usb://1209:0001")
    assert "usb://1209:0001/mock-1" in message
    assert "usb://1209:0001/mock-2" in message


def test_the_error_for_a_missing_rig_lists_those_on_the_bus(lab: Lab):
    assert "no USB rig was" in refused(lab, "usb://1209:0001/mock-1")
    lab.plug(2)
    assert "--device usb://1209:0001/mock-2" in refused(lab, "usb://1209:0001/mock-1")


@pytest.mark.parametrize("url", ["usb://1209:0001/", "usb:///"])
def test_an_empty_serial_number_is_refused(lab, url):
    with pytest.raises(UsageError, match="empty serial number"):
        lab.open(url)


@pytest.mark.parametrize("url", ["usb://rig:1", "usb://12345:1", "usb://1209:", "usb://1209:0001x"])
def test_a_malformed_place_is_a_usage_error(lab: Lab, url: str):
    with pytest.raises(UsageError, match="hexadecimal"):
        lab.open(url)


def test_a_second_opening_fails_because_the_rig_is_in_use(lab: Lab):
    lab.plug()
    lab.open()
    assert "in use" in refused(lab, "usb:")
    lab.opened[0].close()
    assert lab.open().identity.serial == "mock-1"


def test_missing_permission_names_the_command_that_installs_the_udev_rule(lab: Lab):
    lab.plug(1, "refused@0")
    message = refused(lab, "usb:")
    assert "no permission" in message
    assert f"sudo cp '{RULES}'" in message


def test_a_rig_without_a_readable_serial_number_is_found(lab: Lab):
    lab.plug(1, "refused@0")
    assert lab.driver.find() == ["usb://1209:0001"]


def test_a_matching_serial_number_is_preferred_to_an_unreadable_one(lab: Lab):
    lab.plug(1, "refused@0")
    lab.plug(2)
    assert lab.open("usb:///mock-2").identity.serial == "mock-2"
    assert "no permission" in refused(lab, "usb:///mock-1")


def test_without_libusb_nothing_is_found_and_opening_names_the_package(
    monkeypatch: pytest.MonkeyPatch,
):
    from usb.backend import libusb1

    monkeypatch.setattr(libusb1, "get_backend", lambda *_: None)
    monkeypatch.setattr(errors.sys, "platform", "linux")
    driver = UsbDriver()
    assert driver.find() == []
    with pytest.raises(DeviceError) as caught:
        driver.open(parse_url("usb:"), PROFILE)
    assert "apt install libusb-1.0-0" in caught.value.fix
    with pytest.raises(DeviceError):
        driver.estop(parse_url("usb:"))
    (check,) = driver.examine(parse_url("usb:"))
    assert check.good is False
    assert check.fix == caught.value.fix


def test_the_kernels_list_shows_whether_a_rig_is_on_the_bus(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(devices, "SYSFS", tmp_path / "none")
    assert devices.kernel_lists_one()  # no list: libusb must search
    monkeypatch.setattr(devices, "SYSFS", tmp_path)
    assert not devices.kernel_lists_one()
    for interface, triple in {"1-1:1.0": ("03", "01", "02"), "1-2:1.0": ("ff", "48", "01")}.items():
        assert not devices.kernel_lists_one()
        (tmp_path / interface).mkdir()
        for name, value in zip(("Class", "SubClass", "Protocol"), triple, strict=True):
            (tmp_path / interface / f"bInterface{name}").write_text(value + "\n")
    assert devices.kernel_lists_one()


def test_doctor_reports_the_rig_of_the_url(lab: Lab):
    lab.plug(3)
    checks = {c.what: c for c in lab.driver.examine(parse_url("usb:"))}
    assert checks["libusb"].good
    assert checks["USB rig"].good
    assert "mock-3" in checks["USB rig"].found
    assert "480 Mbit/s" in checks["USB rig"].found
    missing = {c.what: c for c in lab.driver.examine(parse_url("usb:///other"))}["USB rig"]
    assert missing.good is False
    assert missing.fix


@pytest.mark.parametrize(
    "option", ["stream=2", "signs=up", "watchdog_s=5", "watchdog_s=x", "timeout_s=0"]
)
def test_an_option_out_of_range_names_the_range(lab: Lab, option: str):
    lab.plug()
    with pytest.raises(UsageError) as caught:
        lab.open(f"usb:?{option}")
    assert caught.value.fix


def test_a_real_rig_does_not_take_the_options_of_the_emulated_one(lab: Lab):
    lab.plug()
    with pytest.raises(UsageError, match="no option 'hide'"):
        lab.open("usb:?hide=motor.lag:0.1")


@pytest.mark.parametrize("text", ["melt@1", "unplug@x", "unplug", "stall_in@1:2:3", "silent@-1"])
def test_a_malformed_bus_fault_is_refused(text: str):
    with pytest.raises(UsageError, match="is not a fault of a USB bus"):
        BusFault.of(text)


def test_the_page_names_every_option_of_both_drivers():
    page = (ROOT / "docs" / "how-to" / "connect-a-rig.md").read_text(encoding="utf-8")
    options = {cell for row in page.splitlines() for cell in row.split("|")[1:2]}
    assert all(any(f"`{option}`" in cell for cell in options) for option in UsbDriver.options)
    assert set(UsbMockDriver.options) == {*UsbDriver.options, *RigOptions.names(), "bus"}


def test_an_emulated_rig_is_not_listed_but_can_be_opened():
    driver = UsbMockDriver()
    assert driver.find() == []
    rig = driver.open(parse_url("usb+mock:?seed=5&noise=0"), PROFILE)
    assert rig.identity.serial == "mock-5"
    assert rig.identity.emulated
    rig.close()


def test_the_url_sets_the_faults_of_the_emulated_bus():
    url = parse_url("usb+mock:?bus=refused@0&bus=silent@5")
    with pytest.raises(DeviceError, match="no permission"):
        UsbMockDriver().open(url, PROFILE)
