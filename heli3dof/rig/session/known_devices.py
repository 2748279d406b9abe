"""Where a rig was opened before: what may be stopped unasked, and which serial number it has.

A serial port may lead to anything: bytes that stop a rig may start another instrument. A place is
known where

    its driver lists nothing but rigs (it has no ``surely``), or ``surely(url)`` says that one is
    there now, or a rig was opened there before

`remember` keeps ``lasting(url)``, what the place is called however it is plugged in, the device URL
and the serial number in <state>/places, a line each, with tabs in between.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from heli3dof.rig.drivers import load_driver
from heli3dof.rig.session.paths import device_name, state_folder
from heli3dof.rig.url import DeviceUrl, parse_url

MOST = 200
"""Lines that are kept, the last ones: a rig at a new pseudo-terminal or TCP port adds one each"""


def is_known(device: str) -> bool:
    """Whether it may be spoken to, unasked, as to a rig."""
    url = parse_url(device)
    surely = getattr(load_driver(url.scheme), "surely", None)
    return surely is None or surely(url) or any(_place(url) == line[0] for line in _lines())


def remembered() -> Iterator[str]:
    """URLs at which a rig was opened before, where the same thing is plugged in now.

    Those of drivers that cannot list their rigs for sure, and so have ``lasting``.
    """
    for place, device, _ in _lines():
        with suppress(Exception):  # a line of before 2026-11, or a driver that was taken away
            url = parse_url(device)
            if hasattr(load_driver(url.scheme), "lasting") and _place(url) == place:
                yield device


def serials_at(device: str) -> set[str]:
    """Serial numbers that rigs opened at this URL's place had, or that the URL itself names."""
    url = parse_url(device)
    name = device_name(url)
    found = {serial for _, at, serial in _lines() if at and device_name(at) == name}
    return found | {url.where.rpartition("/")[2]}


def remember(device: str, serial: str) -> None:
    """A rig has answered there. A state folder that cannot be written hinders no flight."""
    with suppress(OSError):
        line = (_place(parse_url(device)), device, serial)
        kept = _lines()
        if line not in kept:
            kept = [*[each for each in kept if each[0] != line[0]][1 - MOST :], line]
            _file().parent.mkdir(parents=True, exist_ok=True)
            _file().write_text("".join("\t".join(k) + "\n" for k in kept), encoding="utf-8")


def _place(url: DeviceUrl) -> str:
    lasting = getattr(load_driver(url.scheme), "lasting", None)
    return f"{url.scheme} {url.where if lasting is None else lasting(url)}"


def _lines() -> list[tuple[str, str, str]]:
    """(place, device URL, serial number); the last two are empty in files of before 2026-11."""
    try:
        text = _file().read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return []
    rows = [[*line.split("\t"), "", ""] for line in text.splitlines()]
    return [(row[0], row[1], row[2]) for row in rows]


def _file() -> Path:
    return state_folder() / "places"
