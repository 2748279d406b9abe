"""The errors of a rig on a Quanser board; maps HIL error codes to messages with cause and fix.

The vendor's HIL library raises HILError with a negative ``error_code``; the numbers are those of
the vendor's quanser_errors.h.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum

from heli3dof.errors import DeviceError

from ..errors import ErrorTable, ErrorTemplate


class Qerr(IntEnum):
    """The HIL library's error numbers that this driver distinguishes, without their minus sign."""

    NO_PERMISSION = 11
    TIMED_OUT = 14
    LIBRARY_NOT_FOUND = 15
    FUNCTION_NOT_SUPPORTED = 94
    UNABLE_TO_OPEN_DRIVER = 107
    BOARD_NOT_FOUND = 108
    BOARD_IN_USE = 109
    UNABLE_TO_LOCK_DEVICE = 110
    BUFFER_OVERFLOW = 111
    INVALID_BOARD_HANDLE = 113
    INVALID_ANALOG_INPUT_CHANNEL = 121
    INVALID_ENCODER_INPUT_CHANNEL = 124
    INVALID_ANALOG_OUTPUT_CHANNEL = 133
    INVALID_DIGITAL_OUTPUT_CHANNEL = 139
    CLOCK_NOT_SUPPORTED = 144
    HARDWARE_CLOCK_IN_USE = 145
    CLOCK_FREQUENCY_TOO_HIGH = 150
    CLOCK_FREQUENCY_TOO_LOW = 151
    CLOCK_FREQUENCY_INVALID = 152
    UNRECOGNIZED_BOARD_TYPE = 179
    OVERSAMPLING_DETECTED = 190
    INVALID_LICENSE = 194
    MISSING_LICENSE_FILE = 195
    INVALID_BOARD_IDENTIFIER = 401
    INVALID_DEVICE_HANDLE = 402
    SET_ANALOG_OUTPUT_RANGES_NOT_SUPPORTED = 461
    SET_DIGITAL_DIRECTIONS_NOT_SUPPORTED = 464
    SET_ENCODER_QUADRATURE_MODE_NOT_SUPPORTED = 466
    EXCLUSIVE_ACCESS_ALREADY_GRANTED = 540
    ANALOG_EXPIRATION_NOT_SUPPORTED = 591
    DIGITAL_EXPIRATION_NOT_SUPPORTED = 592
    WATCHDOG_START_NOT_SUPPORTED = 595
    WATCHDOG_STOP_NOT_SUPPORTED = 596
    WATCHDOG_RELOAD_NOT_SUPPORTED = 597
    WATCHDOG_CLEAR_NOT_SUPPORTED = 599
    DIGITAL_EXPIRATION_STATE_NOT_TRISTATE = 602
    ANALOG_EXPIRATIONS_NOT_CONFIGURED = 604
    DIGITAL_EXPIRATIONS_NOT_CONFIGURED = 605
    Q8_SERIES_EXPIRATIONS_NOT_CONFIGURED = 614
    NO_SUCH_DEVICE = 670


OVERRUN = (Qerr.BUFFER_OVERFLOW, Qerr.OVERSAMPLING_DETECTED)
_GONE = (Qerr.NO_SUCH_DEVICE, Qerr.INVALID_BOARD_HANDLE, Qerr.INVALID_DEVICE_HANDLE)
_BUSY = (
    Qerr.BOARD_IN_USE, Qerr.UNABLE_TO_LOCK_DEVICE, Qerr.EXCLUSIVE_ACCESS_ALREADY_GRANTED,
)  # fmt: skip
_NO_WATCHDOG = (
    Qerr.ANALOG_EXPIRATION_NOT_SUPPORTED, Qerr.DIGITAL_EXPIRATION_NOT_SUPPORTED,
    Qerr.WATCHDOG_START_NOT_SUPPORTED, Qerr.WATCHDOG_RELOAD_NOT_SUPPORTED,
)  # fmt: skip
EVERY_OUTPUT = (
    Qerr.ANALOG_EXPIRATIONS_NOT_CONFIGURED, Qerr.DIGITAL_EXPIRATIONS_NOT_CONFIGURED,
    Qerr.Q8_SERIES_EXPIRATIONS_NOT_CONFIGURED,
)  # fmt: skip
"""Errors of a board that needs the watchdog's expiration states of all its outputs, not of some"""
_CLOCK = (
    Qerr.CLOCK_NOT_SUPPORTED, Qerr.CLOCK_FREQUENCY_TOO_HIGH, Qerr.CLOCK_FREQUENCY_TOO_LOW,
    Qerr.CLOCK_FREQUENCY_INVALID,
)  # fmt: skip
_CHANNEL = {
    Qerr.INVALID_ANALOG_INPUT_CHANNEL: "current",
    Qerr.INVALID_ENCODER_INPUT_CHANNEL: "roll, pitch, yaw",
    Qerr.INVALID_ANALOG_OUTPUT_CHANNEL: "front, back",
    Qerr.INVALID_DIGITAL_OUTPUT_CHANNEL: "enable",
}
ERRORS: ErrorTable = {
    Qerr.BOARD_NOT_FOUND: ErrorTemplate(
        "{name}: there is no such board.",
        "it is unplugged, has no power, or is a board of another type.",
        "plug it in and wait for its light; the URL is quanser://BOARD/NUMBER, "
        "e.g. quanser://q8_usb/0",
    ),
    **dict.fromkeys(
        (Qerr.UNRECOGNIZED_BOARD_TYPE, Qerr.INVALID_BOARD_IDENTIFIER),
        ErrorTemplate(
            "{name}: the HIL library does not know this board name.",
            "a typing error, or a board that this system's library does not support "
            "(on Linux it supports fewer than on Windows).",
            "the names are in the HIL documentation: q8_usb, q2_usb, qpid_e, ...",
        ),
    ),
    **dict.fromkeys(
        _BUSY,
        ErrorTemplate(
            "{name} is in use.",
            "another program holds the board: QUARC, Simulink, or another heli3dof.",
            "stop that program; the amplifier's red button stops the motors meanwhile",
        ),
    ),
    Qerr.NO_PERMISSION: ErrorTemplate(
        "{name}: this user has no permission to open it.",
        "the system does not give this user access to the board.",
        "sudo apt-get install --reinstall quanser-sdk, then plug the board in again",
    ),
    **dict.fromkeys(
        (Qerr.UNABLE_TO_OPEN_DRIVER, Qerr.LIBRARY_NOT_FOUND),
        ErrorTemplate(
            "{name}: the board's driver does not load.",
            "the HIL library is installed, but the driver for this board is not.",
            "install the Quanser SDK again, for this board's type",
        ),
    ),
    **dict.fromkeys(
        (Qerr.INVALID_LICENSE, Qerr.MISSING_LICENSE_FILE),
        ErrorTemplate(
            "{name}: the HIL library has no valid licence.",
            "QUARC is installed, but its licence is missing or has expired.",
            "renew the licence, or install the Quanser SDK instead of QUARC",
        ),
    ),
    **dict.fromkeys(
        OVERRUN,
        ErrorTemplate(
            "{name}: samples were lost: the board's buffer overflowed while {doing}.",
            "the host stalled for longer than the buffer holds; the motors were stopped.",
            "heli3dof doctor; close the programs that keep this machine busy",
        ),
    ),
    **dict.fromkeys(
        (*_GONE, Qerr.TIMED_OUT),
        ErrorTemplate(
            "{name} was lost while {doing}.",
            "its cable came out or it lost its power. The board's watchdog switches the "
            "outputs off.",
            "plug it in and secure the cable; then open it again",
        ),
    ),
    Qerr.HARDWARE_CLOCK_IN_USE: ErrorTemplate(
        "{name}: the board's clock is in use.",
        "another program times its samples with it.",
        "end that program, or use another clock: clock=1",
    ),
    **dict.fromkeys(
        _CLOCK,
        ErrorTemplate(
            "{name}: the board's clock cannot run at the profile's rate.",
            "the board is too slow for this rate, or this clock cannot time samples.",
            "lower [loop] rate_hz in the profile, or use another clock: clock=1",
        ),
    ),
    **dict.fromkeys(
        _CHANNEL,
        ErrorTemplate(
            "{name}: the board has no such channel.",
            "one of {channels} in the URL is beyond what this board has.",
            "look at the terminal board and write each channel into the URL",
        ),
    ),
    **dict.fromkeys(
        EVERY_OUTPUT,
        ErrorTemplate(
            "{name} cannot be used: its watchdog needs the state of every output.",
            "the board does not report how many outputs it has.",
            "update the board's firmware and the HIL library",
        ),
    ),
    **dict.fromkeys(
        _NO_WATCHDOG,
        ErrorTemplate(
            "{name} cannot be used: its watchdog cannot switch the outputs off.",
            "this type of board has no expiration states: if this computer hangs, the "
            "motors keep the last voltage.",
            "use a board whose watchdog has them, e.g. a q8_usb",
        ),
    ),
}
"""Error number without its sign → texts"""


def code_of(error: BaseException) -> int:
    """Return the error number of a HILError without its minus sign; 0 for any other error."""
    return abs(int(getattr(error, "error_code", 0)))


def explain(error: BaseException, name: str, doing: str) -> DeviceError:
    """Return the DeviceError that explains ``error``, an exception of the HIL library.

    ``name``: the rig's URL; ``doing``: the operation that failed, as text, e.g. "being armed".
    """
    code = code_of(error)
    known = ERRORS.get(code)
    if known is not None:
        channels = _CHANNEL[Qerr(code)] if code in _CHANNEL else ""
        return known.error(name=name, doing=doing, channels=channels)
    return DeviceError(
        f"{name}: {_message(error)} while {doing}.",
        cause=f"the HIL library reports error {code}, which this driver does not know."
        if code
        else "the HIL library failed without an error code.",
        fix="heli3dof doctor; see the number in the HIL documentation, Quanser Error Codes",
    )


def _message(error: BaseException) -> str:
    try:
        message = str(error.get_error_message())  # type: ignore[attr-defined]
    except Exception:
        message = str(error) or type(error).__name__
    return message.strip().rstrip(".")


@contextmanager
def explained(hil_error: type[Exception], name: str, doing: str) -> Iterator[None]:
    """Context manager: replace an error of class ``hil_error`` by the DeviceError of `explain`.

    ``name``, ``doing``: as for `explain`.
    """
    try:
        yield
    except hil_error as error:
        raise explain(error, name, doing) from error


def no_library(error: BaseException) -> DeviceError:
    """Return the DeviceError for a missing Python package or HIL library of the vendor.

    ``error`` is the exception that importing the package raised.
    """
    if isinstance(error, ImportError):
        return DeviceError(
            "No Quanser board can be opened: the Python package quanser.hardware is missing.",
            cause="it comes with the vendor's SDK, not from PyPI; or it was installed for "
            "another Python.",
            fix="install the Quanser SDK (github.com/quanser/quanser_sdk) or QUARC, then with "
            "this Python: pip install the quanser_api wheel from the SDK's python folder",
        )
    return DeviceError(
        f"No Quanser board can be opened: the HIL library does not load ({error}).",
        cause="the Python package is installed, but not the vendor's library that it loads.",
        fix="Linux: sudo apt-get install quanser-sdk (github.com/quanser/quanser_sdk_linux); "
        "Windows: install_quanser_sdk.exe (github.com/quanser/quanser_sdk_win64)",
    )


def task_ended(name: str) -> DeviceError:
    return DeviceError(
        f"{name}: the board's encoder task has ended.",
        cause="another program stopped it or took the board; the motors were stopped.",
        fix="end that program, then open the board again",
    )


def not_stopped(
    name: str, problem: BaseException, watchdog_s: float, watching: bool
) -> DeviceError:
    """Return the DeviceError for a board that did not accept an emergency stop.

    ``name``: the rig's URL; ``problem``: the board's error; ``watchdog_s``: the board's watchdog
    timeout, s; ``watching``: True if this watchdog is running.
    """
    message = explain(problem, name, "being stopped").what
    return DeviceError(
        f"{name} did not accept the stop. {message}",
        cause=f"the board is gone or refuses; its watchdog is no longer reloaded and switches "
        f"the outputs off within {watchdog_s:g} s."
        if watching
        else "the board is gone or refuses; it was not armed by this program.",
        fix="press the amplifier's red button or cut its power",
    )


def no_enable_line(name: str) -> DeviceError:
    """Return the DeviceError for a stop of the board ``name`` whose URL says ``enable=none``.

    Such a stop only writes zero volts: a program that still runs may write its volts again.
    """
    return DeviceError(
        f"{name}: zero volts were written, but may not stay.",
        cause="the URL says enable=none: a program that still runs writes its volts again.",
        fix="press the amplifier's red button or cut its power",
    )
