"""Invariants of the output voltages for any sequence of calls and any failing call.

On a clock of the tests' own, so that seconds of silence take none.
"""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

import pytest
from heli3dof_drivers.quanser_hil import QuanserDriver
from heli3dof_drivers.quanser_hil.rig import QuanserRig
from hypothesis import example, given, settings
from hypothesis import strategies as st

from heli3dof.errors import DeviceError
from heli3dof.rig.interface import Command, Flags
from heli3dof.rig.url import parse_url
from tests.clock import Clock, installed

from . import board
from .board import PROFILE
from .stand_in import Laboratory

WATCHDOG_S = 0.1
CALLS = (
    "write_analog", "write_digital", "watchdog_reload", "watchdog_start", "watchdog_stop",
    "watchdog_clear", "task_start", "task_read_encoder", "read_encoder",
)  # fmt: skip

HELPLESS = {"write_analog", "write_digital", "watchdog_start"}
"""If all of them failed, nothing could stop a board that was cleared"""


class Hands:
    """The actions on one board, and their log."""

    def __init__(self, clock: Clock, kind: str) -> None:
        self.clock = clock
        self.lab = Laboratory()
        module = self.lab.module()
        self.driver = QuanserDriver(lambda: module)
        self.board = self.lab.boards[kind, "0"]
        self.board.bench = board.Bench()
        self.url = parse_url(f"quanser://{kind}/0?watchdog_s={WATCHDOG_S}")
        self.sequence = 0
        self.rig: QuanserRig | None = None

    def do(self, what: str, how: Any) -> None:
        with suppress(DeviceError):
            if what == "open":
                self.close()
                self.rig = self.driver.open(self.url, PROFILE)
            elif what == "silence":
                self.clock.sleep(how)
            elif what == "fail":
                if not {how, *self.lab.failing} >= HELPLESS:
                    self.lab.failing[how] = 14
            elif what == "repair":
                self.lab.failing.clear()
            elif what == "overflow":
                for task in self.board.tasks:
                    task.overflowed = True
            elif self.rig is not None:
                self.act(self.rig, what, how)

    def act(self, rig: QuanserRig, what: str, how: Any) -> None:
        if what == "send":
            self.sequence += 1
            sample = rig.exchange(Command(self.sequence, how, -how), 0.0)
            volts = self.board.motor_volts()
            if sample.flags & Flags.ENABLED:
                assert volts == pytest.approx(sample.v_applied)
                assert abs(volts[0]) <= PROFILE.motor.v_max
        elif what == "arm":
            assert rig.arm().v_applied == (0.0, 0.0)
            assert self.board.motor_volts() == (0.0, 0.0)
        elif what == "read":
            rig.read()
        elif what == "stop":
            rig.estop("test")
            assert self.board.motor_volts() == (0.0, 0.0)
        elif what == "close":
            self.close()

    def close(self) -> None:
        if self.rig is not None:
            self.rig.close()
        self.rig = None

    def look(self) -> None:
        """Check the invariants."""
        self.board.advance()
        if self.board.motor_volts() != (0.0, 0.0):
            assert self.board.timeout_s is not None, "volts, and no watchdog"
            assert not self.board.expired
        calls = self.lab.calls
        for k, call in enumerate(calls):
            if call[0] == "write_analog" and any(call[3]):
                before = [c[0] for c in calls[:k] if c[0] != "task_read_encoder"]
                assert before[-1] == "watchdog_reload", "volts without a reload before them"
        calls.clear()


ACTIONS = st.one_of(
    st.tuples(st.just("send"), st.sampled_from([3.0, -7.0, 24.0, 300.0, math.nan, math.inf])),
    st.tuples(
        st.sampled_from(["arm", "arm", "read", "stop", "close", "open", "overflow"]), st.none()
    ),
    st.tuples(st.just("silence"), st.sampled_from([1e-4, 0.01, 0.05, 0.3, 3.0])),
    st.tuples(st.just("fail"), st.sampled_from(CALLS)),
    st.tuples(st.just("repair"), st.none()),
)


NO_WRITES = [("fail", "write_analog"), ("fail", "write_digital")]


@settings(max_examples=150)
@example(kind="q8_usb", actions=[*NO_WRITES, ("arm", None)])
@example(kind="q8_usb", actions=[("silence", 0.3), *NO_WRITES, ("arm", None)])
@example(kind="q8_usb", actions=[("silence", 0.3), ("close", None), *NO_WRITES, ("open", None)])
@given(kind=st.sampled_from(["q8_usb", "q2_usb"]), actions=st.lists(ACTIONS, max_size=25))
def test_voltages_are_always_under_a_watchdog_that_ends_them(
    kind: str, actions: list[tuple[str, Any]]
):
    with pytest.MonkeyPatch.context() as patch:
        clock = installed(patch)
        hands = Hands(clock, kind)
        for what, how in [("open", None), ("arm", None), ("send", 5.0), *actions]:
            hands.do(what, how)
            hands.look()
        clock.sleep(WATCHDOG_S + 0.01)
        hands.board.advance()
        assert hands.board.motor_volts() == (0.0, 0.0)
        hands.close()
        assert hands.board.holders == 0
