"""The checks of the computer, and the commands that correct a failed one."""

from __future__ import annotations

from pathlib import Path

import pytest

from heli3dof.rig.doctor import host
from heli3dof.rig.profile import default_profile

PROFILE = default_profile()


@pytest.fixture
def system(monkeypatch, tmp_path) -> Path:
    monkeypatch.setattr(host, "SYSTEM", tmp_path)
    return tmp_path


def clocks(system: Path, now: str, offered: str) -> None:
    folder = system / "clocksource/clocksource0"
    folder.mkdir(parents=True)
    (folder / "current_clocksource").write_text(now + "\n")
    (folder / "available_clocksource").write_text(offered + "\n")


def governors(system: Path, *names: str) -> None:
    for i, name in enumerate(names):
        folder = system / f"cpu/cpu{i}/cpufreq"
        folder.mkdir(parents=True)
        (folder / "scaling_governor").write_text(name + "\n")


def test_the_processors_own_clock_is_good(system):
    clocks(system, "tsc", "tsc hpet")
    assert host.clock(PROFILE).good is True


def test_the_fix_of_a_slow_clock_is_a_quick_one_that_the_system_offers(system):
    clocks(system, "hpet", "tsc hpet acpi_pm")
    check = host.clock(PROFILE)
    assert check.good is False
    assert check.fix.startswith("echo tsc | sudo tee ")


def test_a_slow_clock_without_another_has_no_fix(system):
    clocks(system, "acpi_pm", "acpi_pm")
    assert host.clock(PROFILE).good is None


def test_an_unnamed_clock_is_judged_by_its_resolution(system):
    assert host.clock(PROFILE).good is True


def test_one_core_with_a_power_saving_governor_is_reported(system):
    governors(system, "performance", "powersave")
    check = host.frequency(PROFILE)
    assert check.good is False
    assert "powersave" in check.found
    assert "echo performance | sudo tee" in check.fix


def test_full_speed_and_no_governor_are_good(system):
    assert host.frequency(PROFILE).good is True
    governors(system, "performance")
    assert host.frequency(PROFILE).good is True


@pytest.mark.parametrize(("busy", "good"), [(0.3, True), (3.4, True), (4.0, None), (20.0, None)])
def test_load_is_compared_with_the_number_of_cores(monkeypatch, busy, good):
    monkeypatch.setattr(host.os, "getloadavg", lambda: (busy, 0.0, 0.0))
    monkeypatch.setattr(host.os, "cpu_count", lambda: 4)
    check = host.load(PROFILE)
    assert check.good is good
    assert bool(check.fix) is (good is None)


def test_rare_late_wake_ups_are_reported(monkeypatch):
    late = iter([0.0] * 495 + [5e-3] * 5)
    monkeypatch.setattr(host, "wait_until", lambda due: due + next(late))
    check = host.wake_up(PROFILE)
    assert check.good is False
    assert "5 of 500 by more than 1 ms" in check.found


def test_punctual_wake_ups_are_good(monkeypatch):
    monkeypatch.setattr(host, "wait_until", lambda due: due + 4e-6)
    check = host.wake_up(PROFILE)
    assert check.good is True
    assert "4 µs at the median" in check.found


def test_every_check_runs_on_this_machine():
    for check in host.checks(PROFILE):
        assert check.found
        assert check.good is not False or check.fix
