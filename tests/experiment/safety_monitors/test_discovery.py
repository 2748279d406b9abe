"""A safety monitor is one file: `monitors_for` finds its class there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from heli3dof.experiment import safety_monitors
from heli3dof.experiment.safety_monitors import monitor_classes, monitors_for
from tests.experiment.safety_monitors.periods import PROFILE, period

NEW = """
from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.safety_monitors import SafetyMonitor
from heli3dof.rig.profile import Profile


class TooManyPeriods(SafetyMonitor):
    order = 45

    def __init__(self, profile: Profile) -> None:
        self._most = 3

    def __call__(self, now: Period) -> str | None:
        return f"period {now.k} is too many" if now.k > self._most else None

    def must_still_fall(self) -> bool:
        return True
"""


@pytest.fixture
def added_monitor(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    """A file with a new monitor, as if it were in the package's folder."""
    (tmp_path / "too_many_periods.py").write_text(NEW)
    monkeypatch.setattr(safety_monitors, "__path__", [*safety_monitors.__path__, str(tmp_path)])
    monitor_classes.cache_clear()
    yield
    monitor_classes.cache_clear()


def test_the_monitors_judge_in_the_documented_order() -> None:
    assert [kind.__name__ for kind in monitor_classes()] == [
        "HostSuspend", "EncoderJump", "LostFrames", "Lateness", "FrozenEncoder", "SilentEncoder",
        "Saturation",
    ]  # fmt: skip


def test_the_package_describes_every_monitor() -> None:
    text = safety_monitors.__doc__ or ""
    for kind in monitor_classes():
        assert re.search(rf"^{kind.order} +`{kind.__name__}` ", text, re.MULTILINE)


@pytest.mark.usefixtures("added_monitor")
def test_a_new_file_is_a_new_monitor() -> None:
    assert [kind.order for kind in monitor_classes()] == [10, 20, 30, 40, 45, 50, 60, 70]
    monitors = monitors_for(PROFILE)
    reports = [monitor(period(4)) for monitor in monitors.each_period]
    assert [report for report in reports if report] == ["period 4 is too many"]
    assert monitors.must_still_fall()


def test_each_flight_gets_new_monitors() -> None:
    first, second = monitors_for(PROFILE), monitors_for(PROFILE)
    assert not set(map(id, first.each_period)) & set(map(id, second.each_period))
    assert (first.at_once(), first.must_still_fall()) == (None, False)
