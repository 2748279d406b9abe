"""Wraps the vendor's HIL library for one board: its calls, with the array types that they need.

The library's documentation gives the type codes of its ``array`` arguments: ``I`` for channels,
``d`` for volts, ``i`` for counts and expiration states, ``b`` for digital states. The library
passes their memory to C, so a wrong type gives a wrong value without an error.

The board has a watchdog of its own::

    start(timeout) ─▶ reload() within every timeout ─▶ stop()

If the program does not call reload() in time, the watchdog expires. The board then sets its analog
outputs to 0 V. It sets its enable lines (digital outputs) to the level that disables the amplifier.
Until the program calls clear(), writing to the outputs has no effect.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from .error_codes import EVERY_OUTPUT, Qerr, code_of, no_library

if TYPE_CHECKING:
    from .wiring import Wiring

DAC_V = 10.0
"""V: the driver sets the analog outputs' range to ± this, as another program may have reduced it"""
FOREVER = 0xFFFFFFFF
"""Number of samples of an endless task, where the library defines no constant for it"""


def library() -> Any:
    """Return the vendor's module ``quanser.hardware``. Raises DeviceError if it is missing."""
    import importlib

    try:
        return importlib.import_module("quanser.hardware")
    except (ImportError, OSError) as error:
        raise no_library(error) from error


class Board:
    """An open data acquisition board. Methods may raise the vendor library's HILError."""

    def __init__(self, hardware: Any, wiring: Wiring) -> None:
        """Open the board and leave its outputs as they are; ``hardware``: the vendor's module."""
        self.hardware = hardware
        self._wiring = wiring
        self.error: type[Exception] = hardware.HILError
        self._motors = array("I", wiring.motors)
        self._volts = array("d", [0.0, 0.0])
        self._encoders = array("I", wiring.encoders)
        self._counts = array("i", [0, 0, 0])
        self._enable = array("I", wiring.enable)
        self._currents = array("I", wiring.current)
        self._sensed = array("d", [0.0] * len(self._currents))
        self._hil = hardware.HIL()
        self._hil.open(wiring.board, wiring.number)

    def prepare(self) -> None:
        """Set zero volts, disable the amplifier and configure the channels named by the URL.

        The URL option ``counts=zero`` also sets the encoder counts to zero.
        """
        hil, hardware = self._hil, self.hardware
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
        if self._wiring.counts == "zero":
            hil.set_encoder_counts(self._encoders, 3, array("i", [0, 0, 0]))

    def firmware(self) -> str:
        """Return the board's firmware version, or "unknown"."""
        # No method reads the serial number, because the vendor's wrapper passes C only one byte.
        names = self.hardware.IntegerProperty
        version = self._properties(names.FIRMWARE_MAJOR_VERSION, names.FIRMWARE_MINOR_VERSION)
        return "unknown" if version is None else f"{version[0]}.{version[1]}"

    def write_volts(self, front: float, back: float) -> None:
        """Set the motor voltages in V; the board outputs them divided by the amplifier gain.

        If either is NaN or infinite, both are set to zero.
        """
        if not (math.isfinite(front) and math.isfinite(back)):
            front = back = 0.0  # a converter's output for NaN is undefined
        gain = self._wiring.gain
        self._volts[0], self._volts[1] = front / gain, back / gain
        self._hil.write_analog(self._motors, 2, self._volts)

    def write_enable(self, on: bool) -> None:
        """Enable (``on``) or disable the amplifier by its enable lines, if the wiring has any."""
        if self._enable:
            level = self._wiring.enable_level if on else 1 - self._wiring.enable_level
            states = array("b", [level] * len(self._enable))
            self._hil.write_digital(self._enable, len(self._enable), states)

    def read_counts(self) -> tuple[int, int, int]:
        """Return the encoders' counts of roll, pitch and yaw at this moment."""
        self._hil.read_encoder(self._encoders, 3, self._counts)
        return self._counts[0], self._counts[1], self._counts[2]

    def read_currents(self) -> tuple[float, float]:
        """Return the currents of front and back motor in A; NaN if no input measures them."""
        if not self._currents:
            return _NO_CURRENTS
        self._hil.read_analog(self._currents, 2, self._sensed)
        scale = self._wiring.amps_per_V
        return self._sensed[0] * scale, self._sensed[1] * scale

    def watchdog_start(self) -> None:
        """Set the outputs' expiration states (states after a watchdog timeout); start the watchdog.

        Some boards, such as the Q8 series, require expiration states for all outputs or for none.
        On these boards, this method sets the states of all outputs.
        """
        hil, timeout_s = self._hil, self._wiring.watchdog_s
        try:
            self._set_expiration(self._motors, self._enable)
            hil.watchdog_start(timeout_s)
        except self.error as error:
            names = self.hardware.IntegerProperty
            if code_of(error) not in EVERY_OUTPUT:
                raise
            outputs = self._properties(
                names.NUMBER_OF_ANALOG_OUTPUTS, names.NUMBER_OF_DIGITAL_OUTPUTS
            )
            if outputs is None:
                raise
            self._set_expiration(array("I", range(outputs[0])), array("I", range(outputs[1])))
            hil.watchdog_start(timeout_s)

    def _set_expiration(self, analog: array[int], lines: array[int]) -> None:
        """Set the states that the board gives to outputs when the watchdog expires.

        ``analog``, ``lines``: channel numbers of the analog and of the digital outputs. All analog
        outputs go to 0 V. The digital outputs that enable the amplifier go to the level that
        disables it. All other digital outputs go to tristate. The Q8 series accepts only tristate,
        so on these boards all digital outputs go to tristate.
        """
        hil, states, n = self._hil, self.hardware.DigitalState, len(lines)
        hil.watchdog_set_analog_expiration_state(
            analog, len(analog), array("d", [0.0] * len(analog))
        )
        if not n:
            return
        rest = states.LOW if self._wiring.enable_level else states.HIGH
        levels = array("i", [rest if c in self._enable else states.TRISTATE for c in lines])
        try:
            hil.watchdog_set_digital_expiration_state(lines, n, levels)
        except self.error as error:
            if code_of(error) != Qerr.DIGITAL_EXPIRATION_STATE_NOT_TRISTATE:
                raise
            tristate = array("i", [states.TRISTATE] * n)
            hil.watchdog_set_digital_expiration_state(lines, n, tristate)

    def watchdog_start_to_expire(self) -> None:
        """Start the watchdog and never reload it, so that the board sets 0 V after the timeout.

        This is the last resort if the program could not switch the outputs off itself. The method
        ignores errors of the board.
        """
        with suppress(self.error):
            self.watchdog_start()

    def watchdog_reload(self) -> bool:
        """Restart the watchdog's timeout. Returns False if it had already expired."""
        return bool(self._hil.watchdog_reload())

    def watchdog_expired(self) -> bool:
        """Return True if the watchdog has expired; False also if the board does not reply."""
        try:
            return bool(self._hil.watchdog_is_expired())
        except self.error:
            return False

    def watchdog_stop(self) -> None:
        self._unless(Qerr.WATCHDOG_STOP_NOT_SUPPORTED, self._hil.watchdog_stop)

    def watchdog_clear(self) -> None:
        """Allow writing to the outputs again after the watchdog has expired."""
        self._unless(Qerr.WATCHDOG_CLEAR_NOT_SUPPORTED, self._hil.watchdog_clear)

    def task_start(self, rate_hz: float, samples: int) -> Any:
        """Start a task that samples the encoders at ``rate_hz`` (Hz), and return it.

        ``samples``: capacity of the task's buffer.
        """
        hil = self._hil
        task = hil.task_create_encoder_reader(samples, self._encoders, 3)
        clock = self.hardware.Clock.HARDWARE_CLOCK_0 + self._wiring.clock
        try:
            hil.task_start(task, clock, rate_hz, getattr(hil, "INFINITE", FOREVER))
        except self.error:
            hil.task_delete(task)
            raise
        return task

    def task_read(self, task: Any, n: int) -> tuple[int, int, int] | None:
        """Wait for ``n`` samples; return the last one's encoder counts, None if the task ended."""
        buffer = self._counts if n == 1 else array("i", [0] * (3 * n))
        if self._hil.task_read_encoder(task, n, buffer) < n:
            return None
        return buffer[-3], buffer[-2], buffer[-1]

    def task_end(self, task: Any) -> None:
        """Stop the encoder task ``task`` and free its buffer."""
        with suppress(self.error):
            self._hil.task_stop(task)
        with suppress(self.error):
            self._hil.task_delete(task)

    def close(self) -> None:
        self._hil.close()

    def _properties(self, *codes: int) -> array[int] | None:
        values = array("i", [0] * len(codes))
        try:
            self._hil.get_integer_property(array("i", codes), len(codes), values)
        except self.error:
            return None
        return values

    def _unless(self, code: int, call: Callable[[], object]) -> None:
        try:
            call()
        except self.error as error:
            if code_of(error) != code:
                raise


def version_of(hardware: Any) -> str:
    """Return the version of the HIL library in module ``hardware``, or "unknown"."""
    try:
        version = hardware.HIL.get_version()
        return f"{version.major}.{version.minor}.{version.release}"
    except Exception:
        return "unknown"


_NO_CURRENTS = (float("nan"), float("nan"))
