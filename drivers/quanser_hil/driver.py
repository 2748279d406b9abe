"""Driver of ``quanser://BOARD/NUMBER``: a rig on a Quanser board, e.g. ``quanser://q8_usb/0``.

The board is reached through the vendor's HIL library, which is not on PyPI and is imported when a
board is opened. The URL states the wiring: see `heli3dof_drivers.quanser_hil.wiring`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from heli3dof.errors import DeviceError
from heli3dof.rig.interface import Check

from ..errors import watchdog_too_short
from .board import Board, library, version_of
from .error_codes import explained, no_enable_line

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile
    from heli3dof.rig.url import DeviceUrl

    from .rig import QuanserRig
    from .wiring import Wiring


class QuanserDriver:
    """Opens rigs on Quanser boards. ``hardware`` is a function that returns the vendor's module."""

    scheme = "quanser"
    options: Sequence[str] = (
        "front", "back", "roll", "pitch", "yaw", "enable", "enabled_by", "gain", "current",
        "amps_per_V", "watchdog_s", "clock", "counts",
    )  # fmt: skip
    """The fields of `Wiring`, named again so that checking them does not import pydantic (slow)"""

    def __init__(self, hardware: Callable[[], Any] = library) -> None:
        self._hardware = hardware

    def find(self) -> Sequence[str]:
        """Return no URLs: the library cannot list boards, and opening one may disturb a run."""
        return ()

    def persistent_name(self, url: DeviceUrl) -> str:
        """Return ``BOARD/NUMBER`` of the URL, because the board's serial number cannot be read."""
        return url.where

    def open(self, url: DeviceUrl, profile: Profile) -> QuanserRig:
        """Return the rig on the URL's board, opened with zero volts and the amplifier disabled."""
        from .rig import QuanserRig
        from .wiring import Wiring

        wiring = Wiring.of(url)
        if wiring.watchdog_s < 2 * profile.dt:
            raise watchdog_too_short(wiring.watchdog_s, profile.dt)
        return QuanserRig(self._board(url, wiring), wiring, profile, url.text)

    def estop(self, url: DeviceUrl) -> str:
        """Disable the amplifier and write zero volts; return a message.

        If a program is using the board, this method opens the board a second time, which some
        boards refuse. That program may write volts again, but a disabled amplifier does not pass
        them to the motors. Raises DeviceError

        - if the board does not open,
        - if the board refuses to write, unless its watchdog has already expired,
        - if the wiring has no enable lines: then only zero volts were written.
        """
        from .wiring import Wiring

        wiring = Wiring.of(url)
        board = self._board(url, wiring)
        try:
            with explained(board.error, url.text, "being stopped"):
                board.write_enable(False)
                board.write_volts(0.0, 0.0)
        except DeviceError:
            if not board.watchdog_expired():
                raise
            return "the board's own watchdog had already switched its outputs off"
        finally:
            board.close()
        if not wiring.enable:
            raise no_enable_line(url.text)
        lines = ", ".join(map(str, wiring.enable))
        return f"amplifier disabled by digital outputs {lines}, and zero volts written"

    def examine(self, url: DeviceUrl) -> Sequence[Check]:
        """Return the results of up to two checks, for ``heli3dof doctor``; opens no board.

        - The vendor's library can be loaded.
        - The URL names digital outputs that enable the amplifier. This check is left out if the
          library cannot be loaded.
        """
        from .wiring import Wiring

        wiring = Wiring.of(url)
        what = "vendor's HIL library"
        try:
            hardware = self._hardware()
        except DeviceError as problem:
            return (Check(what, problem.what, False, problem.fix),)
        return (
            Check(what, f"version {version_of(hardware)}", True),
            Check(
                "enable lines",
                f"digital outputs {', '.join(map(str, wiring.enable))}"
                if wiring.enable
                else "none: only the board's watchdog stops a program that hangs",
                True if wiring.enable else None,
                ""
                if wiring.enable
                else "wire the amplifier's enable input and give its digital output: enable=0",
            ),
        )

    def _board(self, url: DeviceUrl, wiring: Wiring) -> Board:
        hardware = self._hardware()
        with explained(hardware.HILError, url.text, "being opened"):
            return Board(hardware, wiring)
