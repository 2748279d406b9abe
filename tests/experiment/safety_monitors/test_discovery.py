"""A safety monitor is one file: `monitors_for` finds its class there."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from heli3dof.errors import Heli3dofError
from heli3dof.experiment import safety_monitors
from heli3dof.experiment.safety_monitors import SafetyMonitor, monitor_classes, monitors_for
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

    def awaits_fall(self) -> bool:
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


def test_the_built_in_monitors_judge_in_the_documented_order() -> None:
    built_in = [
        "HostSuspend", "SamplingRate", "EncoderJump", "AmplifierOutput", "LostFrames", "Lateness",
        "FrozenEncoder", "SilentEncoder", "Saturation",
    ]  # fmt: skip
    found = [kind.__name__ for kind in monitor_classes()]
    assert [name for name in found if name in built_in] == built_in


def test_no_two_monitors_have_the_same_order() -> None:
    orders = [kind.order for kind in monitor_classes()]
    assert len(set(orders)) == len(orders)


@pytest.mark.parametrize("kind", monitor_classes(), ids=lambda kind: kind.__name__)
def test_the_first_line_of_a_monitors_file_is_a_sentence(kind: type[SafetyMonitor]) -> None:
    first, *_ = (sys.modules[kind.__module__].__doc__ or "").splitlines()
    assert first.endswith(".")


@pytest.mark.usefixtures("added_monitor")
def test_a_new_file_is_a_new_monitor() -> None:
    orders = {kind.__name__: kind.order for kind in monitor_classes()}
    assert list(orders.values()) == sorted(orders.values())
    assert orders["TooManyPeriods"] == 45
    monitors = monitors_for(PROFILE)
    reports = [monitor(period(4)) for monitor in monitors]
    assert [report for report in reports if report] == ["period 4 is too many"]
    assert any(monitor.awaits_fall() for monitor in monitors)


@pytest.mark.usefixtures("added_monitor")
def test_a_file_without_a_monitor_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "no_subclass.py"
    file.write_text(NEW.replace("(SafetyMonitor)", ""), encoding="utf-8")
    with pytest.raises(Heli3dofError, match=r"no_subclass\.py contains no safety monitor"):
        monitors_for(PROFILE)


def test_each_flight_gets_new_monitors() -> None:
    first, second = monitors_for(PROFILE), monitors_for(PROFILE)
    assert not set(map(id, first)) & set(map(id, second))
    assert not any(monitor.stop_without_ramp() or monitor.awaits_fall() for monitor in first)
