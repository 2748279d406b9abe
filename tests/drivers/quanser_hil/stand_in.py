"""A stand-in for the vendor's ``quanser.hardware``: its names, arguments and errors as documented.

Every call is written down, and every array must be of the type that the documentation gives: the
true library hands its memory to C unseen.
"""

from __future__ import annotations

import sys
import time
from array import array
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from .board import TRISTATE, Bench, Board, Task

NOT_FOUND, IN_USE, OVERFLOW, UNKNOWN_TYPE, GONE = 108, 109, 111, 179, 670
NOT_ZERO, NOT_TRISTATE, NOT_ALL_OUTPUTS = 601, 602, 614
OUTPUTS = 8
"""analog, and digital, of every board here"""
PROPERTIES = {10: 2, 11: 9, 20: OUTPUTS, 22: OUTPUTS}
TYPES = ("q8_usb", "q2_usb", "qpid_e")


class HILError(Exception):
    def __init__(self, error_code: int) -> None:
        self.error_code = error_code

    def get_error_message(self, locale: str | None = None, buffer_size: int = -1) -> str:
        return f"the vendor's words for {-self.error_code}"


class Laboratory:
    """The connected boards, a log of the calls, and the errors to raise."""

    def __init__(self) -> None:
        odd = Bench((3, 2), (5, 6, 7), (4,), 0, 5.0, (1, 0), 0.5)
        self.boards = {
            ("q8_usb", "0"): Board(),
            ("q2_usb", "0"): Board(q8=False),
            ("qpid_e", "0"): Board(odd, q8=False),
            ("qpid_e", "1"): Board(Bench(enable=()), q8=False),
        }
        self.calls: list[tuple[Any, ...]] = []
        self.failing: dict[str, int] = {}
        """Name of a call → the error that it raises"""

    @property
    def names(self) -> list[str]:
        return [c[0] for c in self.calls]

    def module(self) -> ModuleType:
        """The module ``quanser.hardware`` of these boards."""
        made: Any = ModuleType("quanser.hardware")
        made.HIL = type("HIL", (_Hil,), {"_laboratory": self})
        made.HILError = HILError
        made.Clock = SimpleNamespace(HARDWARE_CLOCK_0=0)
        made.DigitalState = SimpleNamespace(LOW=0, HIGH=1, TRISTATE=2, NO_CHANGE=3)
        made.EncoderQuadratureMode = SimpleNamespace(NONE=0, X1=1, X2=2, X4=4)
        made.IntegerProperty = SimpleNamespace(
            FIRMWARE_MAJOR_VERSION=10,
            FIRMWARE_MINOR_VERSION=11,
            NUMBER_OF_ANALOG_OUTPUTS=20,
            NUMBER_OF_DIGITAL_OUTPUTS=22,
        )
        return made


def install(monkeypatch: pytest.MonkeyPatch) -> Laboratory:
    """Make ``quanser.hardware`` importable for one test."""
    laboratory = Laboratory()
    monkeypatch.setitem(sys.modules, "quanser", ModuleType("quanser"))
    monkeypatch.setitem(sys.modules, "quanser.hardware", laboratory.module())
    return laboratory


class _Hil:
    _laboratory: Laboratory
    INFINITE = 0xFFFFFFFF

    def __init__(self) -> None:
        self._board: Board | None = None
        self._tasks: list[Task] = []

    @staticmethod
    def get_version() -> Any:
        return SimpleNamespace(major=4, minor=5, release=6, build=7)

    def _call(self, name: str, *arguments: Any) -> Board:
        """Log the call and return the open board, or raise the error that is set."""
        lab = self._laboratory
        lab.calls.append((name, *(list(a) if isinstance(a, array) else a for a in arguments)))
        if name in lab.failing:
            raise HILError(-lab.failing[name])
        board = self._board
        assert board is not None, f"{name} of a board that is not open"
        if not board.plugged:
            raise HILError(-GONE)
        return board

    def open(self, card_type: str, card_identifier: str) -> None:
        lab = self._laboratory
        lab.calls.append(("open", card_type, card_identifier))
        if "open" in lab.failing:
            raise HILError(-lab.failing["open"])
        if card_type not in TYPES:
            raise HILError(-UNKNOWN_TYPE)
        board = lab.boards.get((card_type, card_identifier))
        if board is None or not board.plugged:
            raise HILError(-NOT_FOUND)
        if board.holders and not board.shared:
            raise HILError(-IN_USE)
        board.holders += 1
        self._board = board

    def close(self) -> None:
        self._laboratory.calls.append(("close",))
        if self._board is not None:
            self._board.holders -= 1
            for task in self._tasks:
                self._board.stop(task)
            self._board = None

    # Configuration

    def set_analog_output_ranges(self, channels: Any, n: int, minima: Any, maxima: Any) -> None:
        _of("I", channels, n), _of("d", minima, n), _of("d", maxima, n)
        self._call("set_analog_output_ranges", channels, n, minima, maxima)

    def set_digital_directions(self, inputs: Any, n_in: int, outputs: Any, n_out: int) -> None:
        assert inputs is None
        assert n_in == 0
        _of("I", outputs, n_out)
        self._call("set_digital_directions", inputs, n_in, outputs, n_out)

    def set_encoder_quadrature_mode(self, channels: Any, n: int, modes: Any) -> None:
        _of("I", channels, n), _of("i", modes, n)
        self._call("set_encoder_quadrature_mode", channels, n, modes)

    def set_encoder_counts(self, channels: Any, n: int, counts: Any) -> None:
        _of("I", channels, n), _of("i", counts, n)
        self._call("set_encoder_counts", channels, n, counts)

    def get_integer_property(self, properties: Any, n: int, buffer: Any) -> None:
        _of("i", properties, n), _of("i", buffer, n)
        self._call("get_integer_property", properties, n)
        buffer[:] = array("i", [PROPERTIES[p] for p in properties])

    # Immediate inputs and outputs

    def read_encoder(self, channels: Any, n: int, buffer: Any) -> None:
        _of("I", channels, n), _of("i", buffer, n)
        board = self._call("read_encoder", channels, n)
        board.advance()
        buffer[:] = array("i", board.counts(list(channels)))

    def read_analog(self, channels: Any, n: int, buffer: Any) -> None:
        _of("I", channels, n), _of("d", buffer, n)
        board = self._call("read_analog", channels, n)
        board.advance()
        buffer[:] = array("d", [board.sensed(c) for c in channels])

    def write_analog(self, channels: Any, n: int, buffer: Any) -> None:
        _of("I", channels, n), _of("d", buffer, n)
        assert all(abs(v) <= 10 for v in buffer), "beyond the output's range"
        board = self._call("write_analog", channels, n, buffer)
        board.write(dict(zip(channels, buffer, strict=True)), {})

    def write_digital(self, channels: Any, n: int, buffer: Any) -> None:
        _of("I", channels, n), _of("b", buffer, n)
        board = self._call("write_digital", channels, n, buffer)
        board.write({}, dict(zip(channels, buffer, strict=True)))

    # Tasks

    def task_create_encoder_reader(self, samples_in_buffer: int, channels: Any, n: int) -> Task:
        _of("I", channels, n)
        assert isinstance(samples_in_buffer, int)
        self._call("task_create_encoder_reader", samples_in_buffer, channels, n)
        self._tasks.append(Task(list(channels), samples_in_buffer))
        return self._tasks[-1]

    def task_start(self, task: Task, clock: int, frequency: float, num_samples: int) -> None:
        assert isinstance(task, Task)
        board = self._call("task_start", clock, frequency, num_samples)
        board.start(task, frequency)

    def task_read_encoder(self, task: Task, num_samples: int, buffer: Any) -> int:
        assert 0 < num_samples <= task.capacity
        _of("i", buffer, num_samples * len(task.channels))
        board = self._call("task_read_encoder", num_samples)
        while board.advance() and len(task.buffer) < num_samples:
            if task.overflowed:
                raise HILError(-OVERFLOW)
            if task not in board.tasks:
                return 0
            time.sleep(max(0.0, task.next_s - time.monotonic()))
        if task.overflowed:
            raise HILError(-OVERFLOW)
        got = [c for _ in range(num_samples) for c in task.buffer.popleft()]
        buffer[:] = array("i", got)
        return num_samples

    def task_stop(self, task: Task) -> None:
        self._call("task_stop").stop(task)

    def task_delete(self, task: Task) -> None:
        self._call("task_delete").stop(task)

    # The watchdog

    def watchdog_set_analog_expiration_state(self, channels: Any, n: int, volts: Any) -> None:
        _of("I", channels, n), _of("d", volts, n)
        board = self._call("watchdog_set_analog_expiration_state", channels, n, volts)
        if board.q8 and any(volts):
            raise HILError(-NOT_ZERO)
        board.expiry.setdefault("analog", {}).update(zip(channels, volts, strict=True))

    def watchdog_set_digital_expiration_state(self, channels: Any, n: int, states: Any) -> None:
        _of("I", channels, n), _of("i", states, n)
        board = self._call("watchdog_set_digital_expiration_state", channels, n, states)
        if board.q8 and any(s != TRISTATE for s in states):
            raise HILError(-NOT_TRISTATE)
        board.expiry.setdefault("digital", {}).update(zip(channels, states, strict=True))

    def watchdog_start(self, timeout: float) -> None:
        board = self._call("watchdog_start", timeout)
        given = sum(len(states) for states in board.expiry.values())
        if board.q8 and 0 < given < 2 * OUTPUTS:
            raise HILError(-NOT_ALL_OUTPUTS)
        board.watch(timeout)

    def watchdog_stop(self) -> None:
        board = self._call("watchdog_stop")
        board.advance()
        board.timeout_s = None

    def watchdog_reload(self) -> bool:
        return self._call("watchdog_reload").feed()

    def watchdog_is_expired(self) -> bool:
        board = self._call("watchdog_is_expired")
        board.advance()
        return board.expired

    def watchdog_clear(self) -> None:
        self._call("watchdog_clear").clear()


def _of(typecode: str, values: Any, n: int) -> None:
    assert isinstance(values, array), f"{values!r} has no memory that C could read"
    assert values.typecode == typecode, f"array({values.typecode!r}) where C reads {typecode!r}"
    assert len(values) == n, f"{len(values)} values where C reads {n}"
