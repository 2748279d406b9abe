"""A rig behind a Quanser board; see `heli3dof.rig.interface.Rig`.

::

    IDLE ──arm──▶ ARMED ──the board's watchdog expired──▶ LATCHED
                    └──────estop, NaN command──▶ STOPPED     (from every state)
    LATCHED, STOPPED ──arm──▶ ARMED

One period when ARMED: reload the watchdog, discard older samples, write the volts, wait for the
board's next sample. In every other state no volts are written and the watchdog is not reloaded. So
the watchdog switches the outputs off even if this process has failed to.

The board measures counts only. The volts in a sample are those written, clipped to the amplifier's
limit; the counts per revolution are the profile's.
"""

from __future__ import annotations

import math
import time
from contextlib import suppress
from enum import Enum
from functools import partial
from typing import TYPE_CHECKING

from heli3dof.rig.interface import Command, Flags, Identity, Sample

from ..errors import closed, not_a_voltage, not_armed
from .board import DAC_V, Board, version_of
from .error_codes import explain, explained, not_stopped, task_ended
from .stream import EncoderStream, Ended, Overrun

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile

    from .wiring import Wiring


class State(Enum):
    IDLE = Flags(0)
    ARMED = Flags.ENABLED
    LATCHED = Flags.LATCHED
    STOPPED = Flags.ESTOP


class QuanserRig:
    """An open Quanser board with a helicopter; implements `heli3dof.rig.interface.Rig`."""

    def __init__(self, board: Board, wiring: Wiring, profile: Profile, name: str) -> None:
        """Switch the board's outputs off. If that fails, close the board and raise DeviceError."""
        self._board, self._name = board, name
        self._state = State.IDLE
        self._open = True
        self._watching = False
        self._volts = (0.0, 0.0)
        self._saturated = False
        self._sequence = 0
        self._stream = EncoderStream(board, profile.dt)
        self.statistics = self._stream.statistics
        """Counts of the board's samples since it was opened"""
        self.limit_V = min(profile.motor.v_max, DAC_V * wiring.gain)
        try:
            with explained(board.error, name, "switching its outputs off"):
                board.prepare()
        except BaseException:
            board.watchdog_start_to_expire()
            with suppress(board.error):
                board.close()
            raise
        e = profile.encoder
        self.identity = Identity(
            driver="quanser",
            model=f"Quanser {wiring.board}",
            serial=f"{wiring.board}-{wiring.number}",
            firmware=board.firmware(),
            protocol=f"HIL {version_of(board.hardware)}",
            counts_per_rev=(e.roll, e.pitch, e.yaw),
            v_max=self.limit_V,
            watchdog_s=wiring.watchdog_s,
            timebase="device",
            emulated=False,
        )

    @property
    def device_cause(self) -> str | None:
        """Return "WATCHDOG" in state LATCHED, "HOST_ESTOP" in STOPPED, None in IDLE and ARMED."""
        return {State.LATCHED: "WATCHDOG", State.STOPPED: "HOST_ESTOP"}.get(self._state)

    def arm(self) -> Sample:
        """Start encoder task and watchdog, enable the amplifier at 0 V; return the first sample."""
        self._check_open()
        board = self._board
        try:
            with explained(board.error, self._name, "being armed"):
                if self._watching:
                    problem = self._switch_off()
                    if problem is not None and not board.watchdog_expired():
                        raise problem
                    board.watchdog_stop()
                    self._watching = False
                board.watchdog_clear()
                board.write_volts(0.0, 0.0)
                board.write_enable(False)
                self._stream.start()
                board.watchdog_start()
                self._watching = True
                board.write_enable(True)
                self._state = State.ARMED
                return self._next()
        except BaseException:
            if self._switch_off() is not None and not self._watching:
                board.watchdog_start_to_expire()
                self._watching = True
            raise

    def read(self) -> Sample:
        """Return the next sample that the board takes by its own clock.

        If the board's encoder task is not running, as before the first arming, the method reads the
        encoders at once and returns this reading.
        """
        self._check_open()
        with explained(self._board.error, self._name, "being read"):
            if self._stream.running:
                return self._next(after_now=True)
            counts = self._board.read_counts()
            return self._sample(counts, self._stream.now_s())

    def exchange(self, command: Command, due_s: float) -> Sample:
        """Send a command and return the board's next sample; ``due_s`` is not used."""
        self._check_open()
        v_front, v_back = command.v_front, command.v_back
        if not (math.isfinite(v_front) and math.isfinite(v_back)):
            self.estop("a command that is not a number")
            raise not_a_voltage(command.sequence, v_front, v_back)
        if self._state is State.IDLE:
            raise not_armed(self._name)
        try:
            if self._state is State.ARMED:
                self._command(command.sequence, v_front, v_back)
            return self._next()
        except self._board.error as error:
            self._switch_off()
            raise explain(error, self._name, "running") from error

    def estop(self, reason: str) -> None:
        """Set zero volts and disable the amplifier now; the watchdog is no longer reloaded.

        ``reason`` is not used. Raises DeviceError if the board does not accept the stop.
        """
        if not self._open:
            return
        problem = self._switch_off()
        if problem is not None and not self._board.watchdog_expired():
            raise not_stopped(self._name, problem, self.identity.watchdog_s, self._watching)

    def close(self) -> None:
        """Set zero volts, disable the amplifier, stop watchdog and task, and close the board.

        After its watchdog has expired, the board stays latched until it is opened again. If the
        board does not accept the zero volts, its watchdog keeps running and switches the outputs
        off.
        """
        if not self._open:
            return
        self._open = False
        board = self._board
        problem = self._switch_off()
        if self._watching and problem is None:
            with suppress(board.error):
                board.watchdog_stop()
        self._stream.end()
        with suppress(board.error):
            board.close()

    def _command(self, sequence: int, v_front: float, v_back: float) -> None:
        board, limit = self._board, self.limit_V
        if not board.watchdog_reload():
            self._latch()
            return
        try:
            self._stream.discard_waiting()
        except Overrun as problem:
            self._overran(problem)
        front, back = max(-limit, min(limit, v_front)), max(-limit, min(limit, v_back))
        try:
            board.write_volts(front, back)
        except board.error:
            if not board.watchdog_expired():
                raise
            self._latch()
            return
        self._volts, self._sequence = (front, back), sequence
        self._saturated = (front, back) != (v_front, v_back)

    def _next(self, *, after_now: bool = False) -> Sample:
        stream = self._stream
        try:
            if not stream.running:
                stream.start()
            elif after_now:
                stream.discard_waiting()
            counts = stream.next()
        except Overrun as problem:
            self._overran(problem)
            counts = stream.next()
        except Ended as problem:
            self._switch_off()
            stream.end()
            raise task_ended(self._name) from problem
        return self._sample(counts, stream.time_s)

    def _overran(self, problem: Overrun) -> None:
        armed = self._state is State.ARMED
        if armed:
            self._switch_off()
        self._stream.start(overrun=True)
        if armed:
            assert problem.__cause__ is not None
            raise explain(problem.__cause__, self._name, "running") from problem

    def _sample(self, counts: tuple[int, int, int], device_s: float) -> Sample:
        arrived_s = time.monotonic()
        flags = self._state.value | (Flags.SATURATED if self._saturated else Flags(0))
        currents = self._board.read_currents()
        return Sample(self._sequence, device_s, counts, self._volts, currents, flags, arrived_s)

    def _latch(self) -> None:
        self._state, self._volts, self._saturated = State.LATCHED, (0.0, 0.0), False

    def _switch_off(self) -> BaseException | None:
        """Set zero volts and disable the amplifier; return the board's error, or None."""
        latched = self._state is State.LATCHED
        self._state, self._volts, self._saturated = State.STOPPED, (0.0, 0.0), False
        problem: BaseException | None = None
        if not latched:
            board = self._board
            for write in (
                partial(board.write_volts, 0.0, 0.0),
                partial(board.write_enable, False),
            ):
                try:
                    write()
                except board.error as error:
                    problem = error
        return problem

    def _check_open(self) -> None:
        if not self._open:
            raise closed(self._name)
