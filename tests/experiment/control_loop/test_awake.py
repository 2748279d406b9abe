"""The cores of a virtual machine are kept busy during a flight only, at idle priority."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import pytest

from heli3dof.experiment.control_loop import awake as module
from heli3dof.experiment.control_loop.awake import is_virtual, keep_awake
from heli3dof.experiment.control_loop.cores import available_cores
from heli3dof.experiment.control_loop.realtime_priority import realtime

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="Linux's own calls")


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[str], None]:
    """A computer with these processor flags, without control groups."""
    monkeypatch.setattr(module, "HYPERVISOR", (tmp_path / "type",))
    monkeypatch.setattr(module, "CPUINFO", tmp_path / "cpuinfo")
    monkeypatch.setattr(module, "CGROUPS", tmp_path / "cgroup")
    monkeypatch.setattr(module, "OWN_CGROUP", tmp_path / "mine")

    def write(flags: str) -> None:
        Path(module.CPUINFO).write_text(f"processor : 0\nflags\t\t: fpu vme de{flags} pse\n")

    return write


def spinners(of: int) -> dict[int, int]:
    """Process → core of the processes that the spinner of this process started."""
    result = {}
    for child in children(of):
        if "spinner.py" in Path(f"/proc/{child}/cmdline").read_text():
            for process in children(child):
                (result[process],) = os.sched_getaffinity(process)
    return result


def children(of: int) -> list[int]:
    text = Path(f"/proc/{of}/task/{of}/children").read_text()
    return [int(word) for word in text.split()]


def gone(process: int) -> bool:
    """Whether the process ends within 10 s; a zombie has ended."""
    until = time.monotonic() + 10
    while time.monotonic() < until:
        try:
            if Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] in "ZX":
                return True
        except OSError:
            return True
        time.sleep(0.01)
    return False


def test_the_kernels_report_of_a_hypervisor_is_read(machine: Callable[[str], None]) -> None:
    machine(" hypervisor")
    assert is_virtual()
    machine("")
    assert not is_virtual()
    module.HYPERVISOR[0].write_text("xen\n")
    assert is_virtual()


def test_a_physical_machine_gets_no_spinner(machine: Callable[[str], None]) -> None:
    machine("")
    with ExitStack() as undo:
        assert keep_awake(undo, available_cores(), stay=True) == ()
        assert not spinners(os.getpid())


def test_all_but_the_first_core_are_busy_at_idle_priority_until_the_end(
    machine: Callable[[str], None],
) -> None:
    machine(" hypervisor")
    before = available_cores()
    with ExitStack() as undo:
        (result,) = keep_awake(undo, available_cores(), stay=True)
        processes = spinners(os.getpid())
        assert result.good
        awake = set(before[1:] or before)
        assert set(processes.values()) == awake
        assert os.sched_getaffinity(0) == (awake if len(awake) > 1 else set(before))
        assert {os.sched_getscheduler(one) for one in processes} == {os.SCHED_IDLE}
    assert all(gone(one) for one in processes)
    assert available_cores() == before


def test_of_two_cores_one_is_kept_busy_and_the_flight_may_use_both(
    machine: Callable[[str], None],
) -> None:
    machine(" hypervisor")
    before = available_cores()
    with ExitStack() as undo:
        keep_awake(undo, before[:2], stay=True)
        assert set(spinners(os.getpid()).values()) == set(before[:2][-1:])
        assert available_cores() == before


def test_a_flight_keeps_cores_busy_and_records_it(machine: Callable[[str], None]) -> None:
    machine(" hypervisor")
    with realtime() as granted:
        assert spinners(os.getpid())
    assert "kept busy" in granted.to_dict()["found"][module.WHAT]
    assert not spinners(os.getpid())


@pytest.mark.parametrize(
    ("mine", "file", "text", "rationed"),
    [
        ("0::/", "cpu.max", "200000 100000", True),
        ("0::/", "cpu.max", "max 100000", False),
        ("0::/user/one", "user/cpu.max", "50000 100000", True),
        ("4:cpu,cpuacct:/docker/ab\n0::/", "cpu/docker/ab/cpu.cfs_quota_us", "150000", True),
        ("4:cpu,cpuacct:/docker/ab\n0::/", "cpu/docker/ab/cpu.cfs_quota_us", "-1", False),
        ("3:cpuset:/docker/ab\n0::/", "cpu/docker/ab/cpu.cfs_quota_us", "150000", False),
    ],
)
def test_a_control_group_with_a_quota_gets_no_spinner(
    machine: Callable[[str], None], mine: str, file: str, text: str, rationed: bool
) -> None:
    machine(" hypervisor")
    path = module.CGROUPS / file
    path.parent.mkdir(parents=True)
    path.write_text(text + "\n")
    module.OWN_CGROUP.write_text(mine + "\n")
    with ExitStack() as undo:
        (result,) = keep_awake(undo, available_cores(), stay=True)
        assert bool(spinners(os.getpid())) is not rationed
    assert ("quota" in result.found) is rationed
    assert bool(result.fix) is rationed


FLIGHT = """
import sys, time
from contextlib import ExitStack
from heli3dof.experiment.control_loop import awake
awake.is_virtual = lambda: True
with ExitStack() as undo:
    awake.keep_awake(undo, [0], stay=True)
    print("flying", flush=True)
    time.sleep(60)
"""


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_the_spinner_ends_with_a_killed_flight(how: int) -> None:
    with subprocess.Popen([sys.executable, "-c", FLIGHT], stdout=subprocess.PIPE) as flight:
        assert flight.stdout is not None
        flight.stdout.readline()
        processes = spinners(flight.pid)
        assert processes
        flight.send_signal(how)
    assert all(gone(one) for one in processes)


def test_the_spinner_ignores_the_keyboards_signals(machine: Callable[[str], None]) -> None:
    machine(" hypervisor")
    with ExitStack() as undo:
        keep_awake(undo, available_cores(), stay=True)
        processes = spinners(os.getpid())
        (spinner,) = {int(Path(f"/proc/{p}/stat").read_text().split()[3]) for p in processes}
        for process in (spinner, *processes):
            for which in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
                os.kill(process, which)
        time.sleep(0.2)
        assert spinners(os.getpid()) == processes


def test_a_spinner_that_cannot_start_is_reported(
    machine: Callable[[str], None], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    machine(" hypervisor")
    monkeypatch.setattr(module, "SPINNER", tmp_path / "missing.py")
    with ExitStack() as undo:
        (result,) = keep_awake(undo, available_cores(), stay=True)
    assert result.good is None
    assert "may go idle" in result.found


def test_without_idle_priority_no_core_is_kept_busy(tmp_path: Path) -> None:
    refusing = (
        "import os, runpy, sys\n"
        "def refuse(*ignored): raise PermissionError(1, 'no')\n"
        "os.sched_setscheduler = refuse\n"
        f"sys.argv = [{str(module.SPINNER)!r}, '0']\n"
        f"runpy.run_path({str(module.SPINNER)!r}, run_name='__main__')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", refusing], capture_output=True, input=b"", timeout=60, check=False
    )
    assert done.stdout == b""
