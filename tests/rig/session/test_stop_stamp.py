"""A command begun before an emergency stop cannot arm; a later one can."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from heli3dof.errors import SafetyTrip
from heli3dof.rig.profile import default_profile
from heli3dof.rig.session import stop_stamp
from heli3dof.rig.session.estop import request_estop
from heli3dof.rig.session.open_exclusive import open_rig
from heli3dof.rig.session.paths import runtime_folder
from heli3dof.rig.session.stop_stamp import (
    ALL,
    command_began_ns,
    leave_stamp,
    names_of,
    start_command,
    stopped_since,
)
from tests.rig.fakes import IDENTITY, FakeDriver, FakeRig, only_drivers

PROFILE = default_profile()


@pytest.fixture(autouse=True)
def runtime(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


def armed(device: str) -> bool:
    with open_rig(device, PROFILE) as rig:
        try:
            rig.arm()
        except SafetyTrip:
            return False
    return True


@pytest.mark.parametrize("stopped", [None, "fake://1", "fake://1?speed=1"])
def test_a_command_begun_before_a_stop_does_not_arm_and_one_begun_after_it_does(
    stopped: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    only_drivers(monkeypatch, fake=FakeDriver())
    request_estop(stopped, "smoke")
    with open_rig("fake://1", PROFILE) as rig, pytest.raises(SafetyTrip, match="smoke"):
        rig.arm()
    assert not armed("fake://1")  # so do the next flights of the same command
    start_command()
    assert armed("fake://1")


def test_a_stop_does_not_affect_another_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    only_drivers(monkeypatch, fake=FakeDriver())
    request_estop("fake://2", "smoke")
    assert armed("fake://1")


def test_a_stop_affects_a_rig_through_each_of_its_ports(monkeypatch: pytest.MonkeyPatch) -> None:
    only_drivers(monkeypatch, pipe=FakeDriver(), port=FakeDriver(scheme="port"))
    with open_rig("pipe://1", PROFILE):
        pass
    request_estop("pipe://1", "smoke")
    assert not armed("port://1")


def test_a_stop_by_serial_number_in_the_url_affects_the_rig(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    only_drivers(monkeypatch, fake=FakeDriver())
    request_estop(f"fake://1209:0001/{IDENTITY.serial}", "smoke")
    assert not armed("fake:")


def test_a_stop_while_the_rig_is_being_armed_stops_it(monkeypatch: pytest.MonkeyPatch) -> None:
    class Slow(FakeRig):
        def arm(self):  # type: ignore[no-untyped-def]
            leave_stamp([ALL], "smoke")
            return super().arm()

    driver = FakeDriver()
    only_drivers(monkeypatch, fake=driver)
    monkeypatch.setattr(driver, "open", lambda url, profile: Slow(driver))
    assert not armed("fake://1")


def test_each_attempt_to_arm_checks_permission(monkeypatch: pytest.MonkeyPatch) -> None:
    class Insisting(FakeRig):
        def check_permission(self) -> None:
            raise AssertionError("its holder sets this")

        def arm(self):  # type: ignore[no-untyped-def]
            self.check_permission()
            leave_stamp([ALL], "smoke")
            self.check_permission()
            raise AssertionError("it went on")

    driver = FakeDriver()
    only_drivers(monkeypatch, fake=driver)
    monkeypatch.setattr(driver, "open", lambda url, profile: Insisting(driver))
    assert not armed("fake://1")


def test_a_command_begun_at_the_instant_of_a_stop_is_forbidden() -> None:
    began_ns = time.monotonic_ns()
    leave_stamp([ALL], "smoke")
    assert stopped_since(began_ns, []) is not None
    assert stopped_since(time.monotonic_ns() + 1, []) is None


def test_a_stop_replaces_earlier_stamps() -> None:
    for _ in range(3):
        leave_stamp(names_of("fake://1"), "smoke")
    assert len(list(runtime_folder().glob("*.stop"))) == 1


def test_a_stamp_of_before_a_restart_of_the_computer_is_ignored(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    began_ns = time.monotonic_ns()
    monkeypatch.setattr(stop_stamp, "_boot", lambda: "the one before")
    leave_stamp([ALL], "smoke")
    assert stopped_since(began_ns, []) is not None
    monkeypatch.undo()
    assert stopped_since(began_ns, []) is None
    future = runtime_folder() / f"{ALL}@{time.monotonic_ns() + 10**15}.stop"
    future.write_text("{}")  # where the system has no boot identifier
    assert stopped_since(began_ns, []) is None


def test_invalid_stamps_are_ignored() -> None:
    for name in ("all.stop", "all@.stop", "all@x.stop", "@1.stop"):
        (runtime_folder() / name).write_text("")
    assert stopped_since(0, []) is None


def test_psutil_gives_the_process_start_where_the_kernel_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    exact = stop_stamp._process_start_ns()
    monkeypatch.delattr(time, "CLOCK_BOOTTIME")
    second = 1_000_000_000  # psutil's start of the computer is a whole second on Linux
    assert exact - second - 20_000_000 < stop_stamp._process_start_ns() < exact + 20_000_000


def test_a_program_begins_with_its_process_and_a_prompts_command_with_its_call(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asks = (
        "import time; time.sleep(0.3)\n"
        "from heli3dof.rig.session.stop_stamp import command_began_ns as began\n"
        "print(began(), time.monotonic_ns())"
    )
    before = time.monotonic_ns()
    done = subprocess.run([sys.executable, "-c", asks], capture_output=True, text=True, check=True)
    began, called = map(int, done.stdout.split())
    assert before - 11_000_000 <= began <= called - 300_000_000
    monkeypatch.setattr(sys, "ps1", ">>> ", raising=False)
    now = time.monotonic_ns()
    assert command_began_ns() >= now


def test_a_stop_by_serial_number_does_not_affect_a_private_rig(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Emulated(FakeDriver):
        private_to_process = True

    only_drivers(monkeypatch, fake=Emulated(), port=FakeDriver(scheme="port"))
    leave_stamp(names_of("port://1", [IDENTITY.serial]), "smoke")
    assert armed("fake://1")
    assert not armed("port://2")
    leave_stamp(names_of("fake://1"), "smoke")
    assert not armed("fake://1")
