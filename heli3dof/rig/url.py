"""Parses device URLs: ``scheme:`` or ``scheme://where``, then ``?option=value&option=value``.

``mock:?profile=P&hide=friction.coulomb.yaw:0.03&seed=1&speed=max`` ·
``serial:///dev/ttyACM0?baud=921600`` · ``usb://VID:PID/SERIAL`` · ``quanser://BOARD/ID``
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from urllib.parse import parse_qsl

from heli3dof.errors import UsageError, did_you_mean

DEVICE_VARIABLE = "HELI3DOF_DEVICE"
"""Environment variable with the URL of the rig to use if none is given"""
SEED = re.compile(r"(?<=[?&]seed=)\d+")
"""The seed in an emulated rig's URL"""


@dataclass(frozen=True, slots=True)
class DeviceUrl:
    """A parsed device URL; ``options`` maps each option's name to all values given for it."""

    text: str
    scheme: str
    where: str
    options: Mapping[str, tuple[str, ...]]

    def one(self, name: str, default: str | None = None) -> str | None:
        values = self.options.get(name, ())
        return values[-1] if values else default

    def check_options(self, known: Iterable[str]) -> None:
        """Raise UsageError for an option of the URL that is not in ``known``."""
        known = list(known)
        for name in self.options:
            if name not in known:
                hint = did_you_mean(name, known) if known else "this driver has no options."
                raise UsageError(
                    f"{self.text}: the {self.scheme}: driver has no option {name!r}.",
                    cause=f"a typing error; {hint}" if known else hint,
                    fix=f"heli3dof devices, or one of: {', '.join(known)}"
                    if known
                    else f"--device {self.text.partition('?')[0]}",
                )


def parse_url(text: str) -> DeviceUrl:
    """Return the parsed device URL.

    Raises UsageError if the scheme is missing, or if options have no ``?`` before them.

    >>> parse_url("mock:?seed=1").one("seed")
    '1'
    """
    scheme, colon, rest = text.partition(":")
    if not colon or not scheme:
        is_port = re.fullmatch(r"COM\d+|/dev/.+", text, re.IGNORECASE)
        known = "--device mock: or --device serial:///dev/ttyACM0; heli3dof devices lists them"
        raise UsageError(
            f"{text!r} is not a device URL.",
            cause="the scheme is missing; a device URL is SCHEME:PLACE.",
            fix=f"--device serial://{text}" if is_port else known,
        )
    where, mark, query = rest.partition("?")
    if "=" in where and not mark and "/" not in where:
        raise UsageError(
            f"{text}: options need a question mark before them.",
            cause="without it, they are read as the device's place.",
            fix=f"--device '{scheme}:?{where}'",
        )
    options: dict[str, tuple[str, ...]] = {}
    for name, value in parse_qsl(query, keep_blank_values=True):
        options[name] = (*options.get(name, ()), value)
    return DeviceUrl(text, scheme, where.removeprefix("//"), options)


def url_of_next_flight(urls: Collection[str]) -> str | None:
    """Return the URL for a further flight of the rig that was flown with these ``urls``.

    With a used seed, an emulated rig would repeat the samples; so its URL gets the largest seed
    plus one. A URL with ``spread=`` stays the same, because its seed also draws the rig's
    parameters. Returns None if there is no URL, or if the URLs name different rigs.

    >>> url_of_next_flight(["mock:?seed=3&speed=max", "mock:?seed=5&speed=max"])
    'mock:?seed=6&speed=max'
    >>> url_of_next_flight(["serial:///dev/ttyACM0"])
    'serial:///dev/ttyACM0'
    >>> url_of_next_flight(["mock:?seed=3&spread=0.1"])
    'mock:?seed=3&spread=0.1'
    """
    seeds = [int(seed) for url in urls for seed in SEED.findall(url)]
    following = str(max(seeds, default=0) + 1)
    rigs = {url if "spread=" in url else SEED.sub(following, url) for url in urls}
    return rigs.pop() if len(rigs) == 1 else None
