"""Measures an emergency stop of another process's flight: its duration, and stops at the start."""

from __future__ import annotations

import os
import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from heli3dof.rig.session.client import running, state
from heli3dof.rig.session.estop import request_estop
from tests.bench import Figure, at_least, at_most
from tests.rig.processes import suspend
from tests.rig.stop_race import Race, race

TITLE = "Stopping from another terminal"
INTRO = (
    "`heli3dof run-step` flies the emulated rig behind a pseudo-terminal at 500 Hz, recorder on; "
    "another process stops it. Time from the request to the confirmation that the device has "
    'stopped, without the start of the command (see "The command line").\n\n'
    "Then emergency stops at random moments 0 to 2 s after the start of a flight's process; every "
    "second stop is one of all rigs (`tests/rig/stop_race.py`). After the stop has returned, no "
    "device may be enabled, according to the firmware's log of its output stage and the mock's "
    "samples."
)
FLIGHTS = int(os.environ.get("ESTOP_FLIGHTS", "20"))
RACES = int(os.environ.get("ESTOP_RACES", "200"))
LATEST_S = 2.0
EMULATED_RIG = [sys.executable, "-m", "heli3dof_drivers.emulator.transport_pty", "--with-parent"]
RIG = "mock:?start=level"


def measure() -> list[Figure]:
    by_session = [stopped_in(hung=False) for _ in range(FLIGHTS)]
    past = [stopped_in(hung=True) for _ in range(max(1, FLIGHTS // 4))]
    return [
        at_most(
            f"stopped by the flying session, {what}", value * 1e3, 100, "ms",
            how=f"{FLIGHTS} flights",
        )
        for what, value in (("median", statistics.median(by_session)), ("longest", max(by_session)))
    ] + [
        at_most(
            "stopped directly, session hangs, longest", max(past) * 1e3, 500, "ms",
            how=f"{len(past)} flights suspended with SIGSTOP; including 200 ms "
            "of waiting for the session",
        )
    ] + [figure for kind in ("mock", "firmware") for figure in raced(kind)]  # fmt: skip


def raced(kind: str) -> list[Figure]:
    """Returns the figures of `RACES` flights that were stopped while they started.

    ``kind``: the device, as `race` takes it.
    """
    draw = random.Random(14)
    seen = []
    for k in range(RACES):
        seen.append(race(kind, draw.uniform(0, LATEST_S), everything=k % 2 == 1))
        print(seen[-1], file=sys.stderr, flush=True)
    early = [r for r in seen if not r.was_enabled]

    def armed(races: list[Race]) -> int:
        return sum(r.enabled_after_s > 0 for r in races)

    return [
        at_most(
            f"{kind}: flights armed after the stop returned", armed(seen), 0, "",
            how=f"{RACES} flights; {len(early)} not armed before the stop, "
            f"{sum(r.confirmed for r in seen)} stops found a rig and confirmed",
        ),
        at_least(
            f"{kind}: flights that ended with exit code 4",
            sum(r.code == 4 for r in seen), RACES, "",
        ),
        at_most(f"{kind}: the longest stop", max(r.seconds for r in seen), 2, "s"),
    ]  # fmt: skip


def stopped_in(*, hung: bool) -> float:
    """Returns s from the stop of one flight to its confirmation; ``hung``: of a suspended one."""
    with flying() as (device, process):
        if hung:
            suspend(process)
            result = request_estop(device, "a bench")
            (stopped,) = result.stopped + result.unconfirmed
        assert stopped.done, stopped.how
        assert ("did not answer" in stopped.how) == hung, stopped.how
        return stopped.seconds


@contextmanager
def flying() -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Yields device URL and process of a flight that has been in the air for a second."""
    quiet = subprocess.DEVNULL
    with (
        tempfile.TemporaryDirectory() as folder,
        subprocess.Popen(
            [*EMULATED_RIG, "--device", RIG], stdout=subprocess.PIPE, text=True
        ) as rig,
    ):
        assert rig.stdout is not None
        device = f"serial://{rig.stdout.readline().strip()}"
        words = ["run-step", "--roll", "5", "--device", device, "-o", str(Path(folder) / "f.mcap")]
        run = [sys.executable, "-m", "heli3dof", *words]
        with subprocess.Popen(run, stdout=quiet, stderr=quiet) as process:
            try:
                until = time.monotonic() + 60
                while not any((state(s) or {}).get("phase") == "flying" for s in running(device)):
                    assert time.monotonic() < until, "no flight began within a minute"
                    time.sleep(0.02)
                time.sleep(1.0)
                yield device, process
            finally:
                process.kill()
                rig.kill()
