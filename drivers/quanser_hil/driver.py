"""``quanser://BOARD/NUMBER`` — a rig on a Quanser board, e.g. ``quanser://q8_usb/0``.

The vendor's HIL library does the talking; it is not on PyPI and is imported when a board is
opened. What is plugged in where stands in the URL: see `heli3dof_drivers.quanser_hil.wiring`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from heli3dof.errors import DeviceError
from heli3dof.rig.interface import Check

from .board import Card, library, version_of
from .error_codes import explained
from .errors import no_enable_line, too_slow_a_watchdog
from .wiring import OPTIONS, Wiring

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile
    from heli3dof.rig.url import DeviceUrl

    from .rig import QuanserRig


class QuanserDriver:
    """Opens boards. ``hardware``: gives the vendor's module, the installed one unless given."""

    scheme = "quanser"
    options: Sequence[str] = OPTIONS

    def __init__(self, hardware: Callable[[], Any] = library) -> None:
        self._hardware = hardware

    def find(self) -> Sequence[str]:
        """None: the library cannot list boards, and opening one to see may disturb a flight."""
        return ()

    def persistent_name(self, url: DeviceUrl) -> str:
        """The board's place: `heli3dof estop` reaches a board that was opened there before."""
        return url.where

    def open(self, url: DeviceUrl, profile: Profile) -> QuanserRig:
        """Open the board and put its outputs to rest."""
        from .rig import QuanserRig

        wiring = Wiring.of(url)
        if wiring.watchdog_s < 2 * profile.dt:
            raise too_slow_a_watchdog(url.text, wiring.watchdog_s, profile.dt)
        return QuanserRig(self._card(url, wiring), wiring, profile, url.text)

    def estop(self, url: DeviceUrl) -> str:
        """Zero volts and disabled, on boards that let a second program in.

        A flight that goes on writes its volts again; disabled, they do not reach the motors.
        """
        wiring = Wiring.of(url)
        card = self._card(url, wiring)
        try:
            with explained(card.error, url.text, "being stopped"):
                card.write_enable(False)
                card.write_volts(0.0, 0.0)
        except DeviceError:
            if not card.watchdog_expired():
                raise
            return "the board's own watchdog had put its outputs to rest already"
        finally:
            card.close()
        if not wiring.enable:
            raise no_enable_line(url.text)
        lines = ", ".join(map(str, wiring.enable))
        return f"amplifier disabled by digital outputs {lines}, and zero volts written"

    def examine(self, url: DeviceUrl) -> Sequence[Check]:
        """The vendor's library; the board itself is not opened."""
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
                else "none: a program that hangs is stopped by the board's watchdog alone",
                True if wiring.enable else None,
                "" if wiring.enable else "wire the amplifier's enable input, and name it: enable=0",
            ),
        )

    def _card(self, url: DeviceUrl, wiring: Wiring) -> Card:
        hardware = self._hardware()
        with explained(hardware.HILError, url.text, "being opened"):
            return Card(hardware, wiring)
