"""A rig behind a Quanser board; see `heli3dof.rig.interface.Rig`.

::

    IDLE ──arm──▶ ARMED ──the board's watchdog expired──▶ LATCHED
                    └──────estop, a voltage that is none──▶ STOPPED     (from every state)
    LATCHED, STOPPED ──arm──▶ ARMED

ARMED, one period: reload the watchdog, pass over what was sampled before, write the volts, wait
for the board's next sample. In every other state nothing is written and the watchdog is not
reloaded any more, so it has the last word on what this process left undone.

The board measures counts and nothing else: volts are what was written, clipped to the amplifier's
limit; the counts per revolution are believed to the profile.
"""

from __future__ import annotations

import math
import time
from contextlib import suppress
from enum import Enum
from functools import partial
from typing import TYPE_CHECKING

from heli3dof.rig.interface import Command, Flags, Identity, Sample

from .board import DAC_V, Card
from .error_codes import explain, explained
from .errors import closed, not_a_voltage, not_armed, not_stopped, task_ended
from .stream import EncoderStream, Ended, Overrun, StreamStatistics

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile

    from .wiring import Wiring


class State(Enum):
    IDLE = Flags(0)
    ARMED = Flags.ENABLED
    LATCHED = Flags.LATCHED
    STOPPED = Flags.ESTOP


class QuanserRig:
    """An open board with a helicopter on it."""

    def __init__(self, card: Card, wiring: Wiring, profile: Profile, name: str) -> None:
        """Puts the outputs to rest. Raises DeviceError, and closes the board then."""
        self._card, self._name = card, name
        self._state = State.IDLE
        self._open = True
        self._watching = False
        self._volts = (0.0, 0.0)
        self._saturated = False
        self._sequence = 0
        self._stream = EncoderStream(card, profile.dt)
        self.limit_V = min(profile.motor.v_max, DAC_V * wiring.gain)
        try:
            with explained(card.error, name, "putting its outputs to rest"):
                card.prepare()
        except BaseException:
            card.watchdog_start_to_expire()
            with suppress(card.error):
                card.close()
            raise
        e = profile.encoder
        self._identity = Identity(
            driver="quanser",
            model=f"Quanser {wiring.board}",
            serial=f"{wiring.board}-{wiring.number}",
            firmware=card.firmware(),
            protocol=f"HIL {card.version()}",
            counts_per_rev=(e.roll, e.pitch, e.yaw),
            v_max=self.limit_V,
            watchdog_s=wiring.watchdog_s,
            timebase="device",
            emulated=False,
        )

    @property
    def identity(self) -> Identity:
        return self._identity

    @property
    def statistics(self) -> StreamStatistics:
        """How the board's samples came since it was opened."""
        return self._stream.statistics

    @property
    def device_cause(self) -> str | None:
        """The board states its watchdog only; a stop is this program's."""
        return {State.LATCHED: "WATCHDOG", State.STOPPED: "HOST_ESTOP"}.get(self._state)

    def arm(self) -> Sample:
        """Zero volts, the watchdog set and started, the task started; then the enable lines."""
        self._check_open()
        card = self._card
        try:
            with explained(card.error, self._name, "being armed"):
                if self._watching:
                    problem = self._rest()
                    if problem is not None and not card.watchdog_expired():
                        raise problem
                    card.watchdog_stop()
                    self._watching = False
                card.watchdog_clear()
                card.write_volts(0.0, 0.0)
                card.write_enable(False)
                self._stream.start()
                card.watchdog_start()
                self._watching = True
                card.write_enable(True)
                self._state = State.ARMED
                return self._next()
        except BaseException:
            if self._rest() is not None and not self._watching:
                card.watchdog_start_to_expire()
                self._watching = True
            raise

    def read(self) -> Sample:
        """The board's next sample; of a rig that was never armed, one taken now."""
        self._check_open()
        with explained(self._card.error, self._name, "being read"):
            if self._stream.running:
                return self._next(after_now=True)
            counts = self._card.read_counts()
            return self._sample(counts, self._stream.now_s())

    def exchange(self, command: Command, due_s: float) -> Sample:
        """One period of the board's clock under the command; ``due_s`` is not asked for."""
        self._check_open()
        v_front, v_back = command.v_front, command.v_back
        if not (math.isfinite(v_front) and math.isfinite(v_back)):
            self.estop("a voltage that is not a number")
            raise not_a_voltage(command.sequence, v_front, v_back)
        if self._state is State.IDLE:
            raise not_armed(self._name)
        try:
            if self._state is State.ARMED:
                self._command(command.sequence, v_front, v_back)
            return self._next()
        except self._card.error as error:
            self._rest()
            raise explain(error, self._name, "flying") from error

    def estop(self, reason: str) -> None:
        """Zero volts and disabled now; the watchdog is not reloaded any more."""
        if not self._open:
            return
        problem = self._rest()
        if problem is not None and not self._card.watchdog_expired():
            raise not_stopped(self._name, problem, self._identity.watchdog_s, self._watching)

    def close(self) -> None:
        """Zero volts, disabled, the watchdog and the task ended, the board free for others.

        A latched board stays latched: whoever opens it next clears it, and puts it to rest. One
        that did not take the zero volts keeps its watchdog.
        """
        if not self._open:
            return
        self._open = False
        card = self._card
        problem = self._rest()
        if self._watching and problem is None:
            with suppress(card.error):
                card.watchdog_stop()
        self._stream.end()
        with suppress(card.error):
            card.close()

    def _command(self, sequence: int, v_front: float, v_back: float) -> None:
        card, limit = self._card, self.limit_V
        if not card.watchdog_reload():
            self._latch()
            return
        try:
            self._stream.pass_over()
        except Overrun as problem:
            self._overran(problem)
        front, back = max(-limit, min(limit, v_front)), max(-limit, min(limit, v_back))
        try:
            card.write_volts(front, back)
        except card.error:
            if not card.watchdog_expired():
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
                stream.pass_over()
            counts = stream.next()
        except Overrun as problem:
            self._overran(problem)
            counts = stream.next()
        except Ended as problem:
            self._rest()
            stream.end()
            raise task_ended(self._name) from problem
        return self._sample(counts, stream.time_s)

    def _overran(self, problem: Overrun) -> None:
        """Begin a new task. Samples lost in flight end the flight."""
        armed = self._state is State.ARMED
        if armed:
            self._rest()
        self._stream.start(overrun=True)
        if armed:
            assert problem.__cause__ is not None
            raise explain(problem.__cause__, self._name, "flying") from problem

    def _sample(self, counts: tuple[int, int, int], device_s: float) -> Sample:
        came_s = time.monotonic()
        flags = self._state.value | (Flags.SATURATED if self._saturated else Flags(0))
        return Sample(
            self._sequence, device_s, counts, self._volts, self._card.read_currents(), flags, came_s
        )

    def _latch(self) -> None:
        self._state, self._volts, self._saturated = State.LATCHED, (0.0, 0.0), False

    def _rest(self) -> BaseException | None:
        """Zero volts and disabled, as far as the board still listens; what kept it from it."""
        latched = self._state is State.LATCHED
        self._state, self._volts, self._saturated = State.STOPPED, (0.0, 0.0), False
        problem: BaseException | None = None
        if not latched:
            card = self._card
            for act in (partial(card.write_volts, 0.0, 0.0), partial(card.write_enable, False)):
                try:
                    act()
                except card.error as error:
                    problem = error
        return problem

    def _check_open(self) -> None:
        if not self._open:
            raise closed(self._name)
