"""One board through the vendor's HIL library: its calls, with the arrays that they ask for.

Channels are ``array('I')``, volts ``array('d')``, counts ``array('i')``, digital states
``array('b')`` and expiration states ``array('i')``, as the library's documentation has them: it
hands their memory to C, so a wrong type is a wrong value and no error.

The watchdog, of the board itself::

    start(timeout) ─▶ reload() within timeout, again and again ─▶ stop()
    no reload in time: expired. Analog outputs to 0 V, enable lines to rest, and no more writing
    until clear()
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from .error_codes import EVERY_OUTPUT, Qerr, code_of, no_library
from .wiring import Wiring

DAC_V = 10.0
"""V, the analog outputs' range; a board may have been left at a smaller one"""
FOREVER = 0xFFFFFFFF
"""Samples of a task that does not end, where the library has no name for it"""


def library() -> Any:
    """The vendor's module ``quanser.hardware``. Raises DeviceError where it is not there."""
    import importlib

    try:
        return importlib.import_module("quanser.hardware")
    except (ImportError, OSError) as error:
        raise no_library(error) from error


class Card:
    """The open board. Every method may raise the library's HILError."""

    def __init__(self, hardware: Any, wiring: Wiring) -> None:
        """Open the board; nothing is written."""
        self._hardware = hardware
        self._wiring = wiring
        self.error: type[Exception] = hardware.HILError
        self._motors = array("I", wiring.motors)
        self._volts = array("d", [0.0, 0.0])
        self._encoders = array("I", wiring.encoders)
        self._counts = array("i", [0, 0, 0])
        self._enable = array("I", wiring.enable)
        self._currents = array("I", wiring.currents or ())
        self._sensed = array("d", [0.0] * len(self._currents))
        self._hil = hardware.HIL()
        self._hil.open(wiring.board, wiring.number)

    def prepare(self) -> None:
        """At rest: volts zero, amplifier disabled, channels as the wiring has them."""
        hil, hardware = self._hil, self._hardware
        self.watchdog_clear()
        self.write_volts(0.0, 0.0)
        ends = [array("d", [end, end]) for end in (-DAC_V, DAC_V)]
        self._unless(
            Qerr.SET_ANALOG_OUTPUT_RANGES_NOT_SUPPORTED,
            lambda: hil.set_analog_output_ranges(self._motors, 2, *ends),
        )
        if self._enable:
            self._unless(
                Qerr.SET_DIGITAL_DIRECTIONS_NOT_SUPPORTED,
                lambda: hil.set_digital_directions(None, 0, self._enable, len(self._enable)),
            )
        self.write_enable(False)
        modes = array("i", [hardware.EncoderQuadratureMode.X4] * 3)
        self._unless(
            Qerr.SET_ENCODER_QUADRATURE_MODE_NOT_SUPPORTED,
            lambda: hil.set_encoder_quadrature_mode(self._encoders, 3, modes),
        )
        if self._wiring.zero_counts:
            hil.set_encoder_counts(self._encoders, 3, array("i", [0, 0, 0]))

    def firmware(self) -> str:
        """The board's firmware version, or "unknown".

        The serial number is a string property, and the vendor's wrapper gives C a buffer of one
        byte to write it into: it is never asked for.
        """
        names = self._hardware.IntegerProperty
        found = self._properties(names.FIRMWARE_MAJOR_VERSION, names.FIRMWARE_MINOR_VERSION)
        return "unknown" if found is None else f"{found[0]}.{found[1]}"

    def version(self) -> str:
        """The HIL library's version, or "unknown"."""
        return version_of(self._hardware)

    # Outputs and immediate inputs

    def write_volts(self, front: float, back: float) -> None:
        """Motor volts, over the amplifier's gain."""
        if not (math.isfinite(front) and math.isfinite(back)):
            front = back = 0.0  # what a converter makes of NaN is its own affair
        gain = self._wiring.gain
        self._volts[0], self._volts[1] = front / gain, back / gain
        self._hil.write_analog(self._motors, 2, self._volts)

    def write_enable(self, on: bool) -> None:
        """The enable lines, where there are any."""
        if self._enable:
            level = self._wiring.enabled_by if on else 1 - self._wiring.enabled_by
            states = array("b", [level] * len(self._enable))
            self._hil.write_digital(self._enable, len(self._enable), states)

    def read_counts(self) -> tuple[int, int, int]:
        """Roll, pitch, yaw now."""
        self._hil.read_encoder(self._encoders, 3, self._counts)
        return self._counts[0], self._counts[1], self._counts[2]

    def read_currents(self) -> tuple[float, float]:
        """A, front and back; NaN where they are not wired."""
        if not self._currents:
            return _NO_CURRENTS
        self._hil.read_analog(self._currents, 2, self._sensed)
        scale = self._wiring.amps_per_V
        return self._sensed[0] * scale, self._sensed[1] * scale

    # The watchdog

    def watchdog_start(self) -> None:
        """Both expiration states, then the watch. Zero volts alone leave the enable lines up.

        Some boards, the Q8 series among them, want the states of all their outputs or of none.
        """
        hil, timeout_s = self._hil, self._wiring.watchdog_s
        try:
            self._set_expiration(self._motors, self._enable)
            hil.watchdog_start(timeout_s)
        except self.error as error:
            names = self._hardware.IntegerProperty
            if code_of(error) not in EVERY_OUTPUT:
                raise
            found = self._properties(
                names.NUMBER_OF_ANALOG_OUTPUTS, names.NUMBER_OF_DIGITAL_OUTPUTS
            )
            if found is None:
                raise
            self._set_expiration(array("I", range(found[0])), array("I", range(found[1])))
            hil.watchdog_start(timeout_s)

    def _set_expiration(self, analog: array[int], lines: array[int]) -> None:
        """Analog outputs to 0 V, enable lines to the level that disables, others to tristate.

        The Q8 series refuses a level: its digital outputs all go to tristate.
        """
        hil, states, n = self._hil, self._hardware.DigitalState, len(lines)
        hil.watchdog_set_analog_expiration_state(
            analog, len(analog), array("d", [0.0] * len(analog))
        )
        if not n:
            return
        rest = states.LOW if self._wiring.enabled_by else states.HIGH
        levels = array("i", [rest if c in self._enable else states.TRISTATE for c in lines])
        try:
            hil.watchdog_set_digital_expiration_state(lines, n, levels)
        except self.error as error:
            if code_of(error) != Qerr.DIGITAL_EXPIRATION_STATE_NOT_TRISTATE:
                raise
            tristate = array("i", [states.TRISTATE] * n)
            hil.watchdog_set_digital_expiration_state(lines, n, tristate)

    def watchdog_start_to_expire(self) -> None:
        """The last resort where the outputs cannot be written: the board does it, unattended."""
        with suppress(self.error):
            self.watchdog_start()

    def watchdog_reload(self) -> bool:
        """False where it had expired."""
        return bool(self._hil.watchdog_reload())

    def watchdog_expired(self) -> bool:
        """True where it has expired; False where a board that is gone does not say."""
        try:
            return bool(self._hil.watchdog_is_expired())
        except self.error:
            return False

    def watchdog_stop(self) -> None:
        self._unless(Qerr.WATCHDOG_STOP_NOT_SUPPORTED, self._hil.watchdog_stop)

    def watchdog_clear(self) -> None:
        """Let the outputs be written again."""
        self._unless(Qerr.WATCHDOG_CLEAR_NOT_SUPPORTED, self._hil.watchdog_clear)

    # The encoder task

    def task_start(self, rate_hz: float, samples: int) -> Any:
        """Sample the encoders at a rate into a buffer of so many samples."""
        hil = self._hil
        task = hil.task_create_encoder_reader(samples, self._encoders, 3)
        clock = self._hardware.Clock.HARDWARE_CLOCK_0 + self._wiring.clock
        try:
            hil.task_start(task, clock, rate_hz, getattr(hil, "INFINITE", FOREVER))
        except self.error:
            hil.task_delete(task)
            raise
        return task

    def task_read(self, task: Any, n: int) -> tuple[int, int, int] | None:
        """The last of the next ``n`` samples, when they have come; None: the task has ended."""
        buffer = self._counts if n == 1 else array("i", [0] * (3 * n))
        if self._hil.task_read_encoder(task, n, buffer) < n:
            return None
        return buffer[-3], buffer[-2], buffer[-1]

    def task_end(self, task: Any) -> None:
        """Stop it and free its buffer: the next one begins empty."""
        with suppress(self.error):
            self._hil.task_stop(task)
        with suppress(self.error):
            self._hil.task_delete(task)

    def close(self) -> None:
        self._hil.close()

    def _properties(self, *codes: int) -> array[int] | None:
        """Integer properties of the board; None where it does not say."""
        wanted, found = array("i", codes), array("i", [0] * len(codes))
        try:
            self._hil.get_integer_property(wanted, len(codes), found)
        except self.error:
            return None
        return found

    def _unless(self, code: int, call: Callable[[], object]) -> None:
        """Call, and let this one error pass."""
        try:
            call()
        except self.error as error:
            if code_of(error) != code:
                raise


def version_of(hardware: Any) -> str:
    """The HIL library's version, or "unknown"."""
    try:
        version = hardware.HIL.get_version()
        return f"{version.major}.{version.minor}.{version.release}"
    except Exception:
        return "unknown"


_NO_CURRENTS = (float("nan"), float("nan"))
