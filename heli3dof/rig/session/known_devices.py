"""Records where rigs were opened, so that ``heli3dof estop`` stops only rigs.

A serial port may lead to any instrument, and bytes that stop a rig may start another instrument. A
*place* is the scheme of a device URL, followed by the device's persistent name. If the driver has
no such name, the URL's address follows instead. A place is known to be a rig's if one of these
applies:

- The search of the URL's driver returns only rigs. (A driver whose search also returns other
  instruments has a method ``is_rig``: it is a `RecognisesRigs`.)
- The driver's ``is_rig(url)`` returns True now.
- A rig was opened there before.

`remember` stores a line for each place in the file ``places`` of the state folder
(`session.paths.state_folder`): place, device URL and serial number, separated by tabs.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from heli3dof.rig.drivers import load_driver
from heli3dof.rig.interface import NamesPlaces, RecognisesRigs
from heli3dof.rig.session.paths import device_name, state_folder
from heli3dof.rig.url import DeviceUrl, parse_url

MOST = 200
"""Largest number of lines kept: each new pseudo-terminal or TCP port of a rig adds one"""


def is_known(device: str) -> bool:
    """Return True if the device at this URL is known to be a rig, so that it may be stopped."""
    url = parse_url(device)
    driver = load_driver(url.scheme)
    if not isinstance(driver, RecognisesRigs) or driver.is_rig(url):
        return True
    return any(_place(url) == line[0] for line in _lines())


def remembered() -> Iterator[str]:
    """Yield each URL at which a rig was opened before, if the same device is connected there now.

    Only URLs of drivers that cannot list every rig (`NamesPlaces`) are yielded.
    """
    for place, device, _ in _lines():
        with suppress(Exception):  # a line from before 2026-11, or a driver that was removed
            url = parse_url(device)
            if isinstance(load_driver(url.scheme), NamesPlaces) and _place(url) == place:
                yield device


def serials_at(device: str) -> set[str]:
    """Return possible serial numbers of the rig at this URL.

    They are the numbers of the rigs opened there before, and the text after the URL's last slash.
    """
    url = parse_url(device)
    name = device_name(url)
    serials = {serial for _, at, serial in _lines() if at and device_name(at) == name}
    return serials | {url.where.rpartition("/")[2]}


def remember(device: str, serial: str) -> None:
    """Store that a rig was opened at the URL ``device``, if the state folder is writable."""
    with suppress(OSError):
        line = (_place(parse_url(device)), device, serial)
        kept = _lines()
        if line not in kept:
            kept = [*[each for each in kept if each[0] != line[0]][1 - MOST :], line]
            _file().parent.mkdir(parents=True, exist_ok=True)
            _file().write_text("".join("\t".join(k) + "\n" for k in kept), encoding="utf-8")


def _place(url: DeviceUrl) -> str:
    driver = load_driver(url.scheme)
    name = driver.persistent_name(url) if isinstance(driver, NamesPlaces) else url.where
    return f"{url.scheme} {name}"


def _lines() -> list[tuple[str, str, str]]:
    """Return the stored lines as tuples (place, device URL, serial number).

    A place is the URL's scheme and the device's persistent name, separated by a space. A missing
    field is "".
    """
    try:
        text = _file().read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return []
    rows = [[*line.split("\t"), "", ""] for line in text.splitlines()]
    return [(row[0], row[1], row[2]) for row in rows]


def _file() -> Path:
    return state_folder() / "places"
