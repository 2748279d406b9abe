"""Which of the places that a driver finds are a rig's, told without opening one.

A serial port may lead to anything: bytes that stop a rig may start another instrument. A place is
known where

    its driver lists nothing but rigs (it has no ``surely``), or ``surely(url)`` says that one is
    there now, or a rig was opened there before: `remember` keeps ``lasting(url)``, what the place
    is called however it is plugged in, in <state>/places, a line each
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from heli3dof.rig.drivers import load_driver
from heli3dof.rig.places import state_folder
from heli3dof.rig.url import DeviceUrl, parse_url


def is_known(device: str) -> bool:
    """Whether it may be spoken to, unasked, as to a rig."""
    url = parse_url(device)
    surely = getattr(load_driver(url.scheme), "surely", None)
    return surely is None or surely(url) or _line(url) in _lines()


def remember(device: str) -> None:
    """A rig has answered there. A state folder that cannot be written hinders no flight."""
    url = parse_url(device)
    if not hasattr(load_driver(url.scheme), "surely"):
        return
    line = _line(url)
    with suppress(OSError):
        if line not in _lines():
            _file().parent.mkdir(parents=True, exist_ok=True)
            with _file().open("a", encoding="utf-8") as file:
                file.write(line + "\n")


def _line(url: DeviceUrl) -> str:
    lasting = getattr(load_driver(url.scheme), "lasting", None)
    return f"{url.scheme} {url.where if lasting is None else lasting(url)}"


def _lines() -> list[str]:
    try:
        return _file().read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return []


def _file() -> Path:
    return state_folder() / "places"
