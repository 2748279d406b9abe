"""The runs that are the same on every transport; further cases are in the transports' own files."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from typing import Any

from heli3dof.rig.interface import Command, Flags

from .guest import RATE_HZ, Hand, failure, fly, flying_process, in_another_process, until

LATCHED, STOPPED = 8, 16
WATCHDOG, HOST_ESTOP = 1, 2
PULLED_AFTER_S = 0.2


def polled(rig: Any, periods: int) -> dict[str, Any]:
    """A polled run. A late reply causes a second POLL, whose sample may come after the next
    command: a sample may be one command behind, never ahead."""
    try:
        samples = fly(rig, periods)
        behind = [k - sample.sequence for k, sample in enumerate(samples)]
        assert set(behind) <= {0, 1}, behind
        assert len(samples) == periods + 1
        assert samples[-1].flags == Flags.ENABLED
        assert samples[-1].v_applied == (5.0, 5.0)
        s = rig.statistics
        assert s.malformed == 0
        return {
            "round_trip_median_us": 1e6 * s.round_trip.quantile_s(0.5),
            "round_trip_99_us": 1e6 * s.round_trip.quantile_s(0.99),
            "retries": s.retries,
            "one_behind": sum(behind),
        }
    finally:
        rig.close()


def streamed(rig: Any, periods: int) -> tuple[list[Any], dict[str, Any]]:
    """The samples and the counters of the missing ones."""
    try:
        samples = fly(rig, periods)
        assert samples[-1].flags == Flags.ENABLED
        s = rig.statistics
        assert s.malformed == 0
        lost = {
            "lost": s.lost,
            "samples_stale": s.samples_stale,
            "commands_unacknowledged": s.commands_unacknowledged,
        }
        return samples, lost
    finally:
        rig.close()


def stopped_by_another(rig: Any, hand: Hand, elsewhere: str) -> str:
    """A second process stops the rig; returns its output. ``elsewhere`` defines its ``driver`` and
    ``url``."""
    try:
        assert fly(rig, 10)[-1].flags == Flags.ENABLED
        output = in_another_process(elsewhere + "print(driver.estop(url))")
        assert hand.state() == (STOPPED, HOST_ESTOP, 0, 0)
        assert rig.read().flags & Flags.ESTOP
        return output
    finally:
        rig.close()


OPENING = "try: driver.open(url, profile)\nexcept DeviceError as error: print(error)"


def held(rig: Any, elsewhere: str) -> str:
    """The error of a second process that opens the same rig."""
    try:
        output = in_another_process(elsewhere + OPENING)
        assert f"process {os.getpid()}" in output, output
        return output.splitlines()[0]
    finally:
        rig.close()


def pulled(rig: Any, hand: Hand, gone: Callable[[], bool]) -> tuple[Any, dict[str, Any]]:
    """Unplug the cable during a run: the error and its delay. The rig is not closed."""
    fly(rig, 5)
    threading.Timer(PULLED_AFTER_S, hand, ["pull"]).start()

    def on() -> None:
        for k in range(500):
            rig.exchange(Command(6 + k, 5.0, 5.0), time.monotonic() + 1 / RATE_HZ)

    start = time.monotonic()
    error = failure(on)
    took = time.monotonic() - start
    until(gone, "the rig is gone")
    return error, {"said": error.what, "noticed_s": took - PULLED_AFTER_S}


def killed(hand: Hand, elsewhere: str) -> dict[str, Any]:
    """kill -9 during a run: the kernel frees the port, the watchdog stops the motors."""
    process = flying_process(elsewhere)
    until(lambda: hand.state()[2] == 5_000_000, "five volts are out")
    process.kill()
    process.wait()
    start = time.monotonic()
    until(lambda: hand.state()[2:] == (0, 0), "zero volts")
    took = time.monotonic() - start
    assert hand.state()[:2] == (LATCHED, WATCHDOG)
    return {"zero_after_s": took}


def flies(rig: Any) -> None:
    """Armed, twenty periods, closed."""
    try:
        assert fly(rig, 20)[-1].flags == Flags.ENABLED
    finally:
        rig.close()
