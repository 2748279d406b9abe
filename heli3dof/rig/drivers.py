"""Finds drivers through the entry-point group ``heli3dof.drivers``.

heli3dof never imports a driver package by name, so third-party drivers work like its own. A driver
that cannot be imported causes a warning when rigs are listed, and an error for its own URLs only.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING

from heli3dof.errors import DeviceError, UsageError, did_you_mean, quoted
from heli3dof.plugins import must_be, plugin_errors
from heli3dof.rig.interface import Driver, Identity, PrivateToProcess, Rig
from heli3dof.rig.url import DEVICE_VARIABLE, DeviceUrl, parse_url

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile

GROUP = "heli3dof.drivers"


def registered() -> Mapping[str, EntryPoint]:
    """Return the entry points of the installed drivers by URL scheme."""
    return _read(tuple(sys.path))


@cache
def _read(path: tuple[str, ...]) -> Mapping[str, EntryPoint]:
    """Read the installed drivers in the folders ``path``, once: 16 ms, and a flight asks 6 times.

    A driver that is installed later is found because `load_driver` empties the cache.
    """
    return {e.name: e for e in entry_points(group=GROUP)}


def load_driver(scheme: str) -> Driver:
    """Return the driver for a URL scheme.

    A scheme with a +, such as ``serial+socket``, need not have a driver of its own. It then uses
    the driver of the part before the +. Raises UsageError for an unknown scheme, DeviceError if the
    driver cannot be loaded.
    """
    base = scheme.partition("+")[0]
    if not {scheme, base} & registered().keys():
        _read.cache_clear()
    known = registered()
    if scheme not in known:
        scheme = base
    if scheme not in known:
        raise UsageError(
            f"There is no driver for {scheme + ':'!r}.",
            cause=f"a typing error in the device URL; {did_you_mean(scheme, known)}",
            fix="heli3dof devices",
        )
    try:
        factory = known[scheme].load()
        driver: Driver = factory()
    except (Exception, SystemExit) as error:
        raise DeviceError(
            f"The driver for {scheme + ':'!r} does not load: {error}",
            cause=f"its package ({known[scheme].value}) is broken or lacks a dependency.",
            fix="pip install --force-reinstall the package that provides it",
        ) from error
    return driver


def driver_errors(part: object) -> AbstractContextManager[None]:
    """Return a context manager: a bug in a driver becomes a DeviceError that names its package.

    ``part``: the driver, or a rig that it opened.
    """
    kind = type(part)
    return plugin_errors(DeviceError, f"The driver's class {kind.__name__}", kind.__module__)


def check_url(url: str | DeviceUrl) -> DeviceUrl:
    """Return the parsed device URL. Raises UsageError for an unknown scheme or option."""
    parsed = parse_url(url) if isinstance(url, str) else url
    driver = load_driver(parsed.scheme)
    with driver_errors(driver):
        parsed.check_options(driver.options)
    return parsed


def open_driver(url: str | DeviceUrl, profile: Profile) -> Rig:
    """Open the rig of a device URL without locking the rig.

    ``heli3dof estop`` cannot request a stop from a process that uses this function. Applications
    therefore use `heli3dof.open_rig`.
    """
    parsed = check_url(url)
    driver = load_driver(parsed.scheme)
    with driver_errors(driver):
        rig = driver.open(parsed, profile)
        must_be(Identity, rig.identity)
    return rig


def is_private(url: str | DeviceUrl) -> bool:
    """Return True for the URL of an emulated rig, which exists only in the process opening it."""
    parsed = parse_url(url) if isinstance(url, str) else url
    driver = load_driver(parsed.scheme)
    return isinstance(driver, PrivateToProcess) and driver.private_to_process


def with_seed(url: str, seed: int) -> str:
    """Return the URL with the option ``seed`` added, which seeds an emulated rig's noise.

    The URL stays the same if its driver does not know this option, or if the URL already has a
    seed.
    """
    parsed = check_url(url)
    if "seed" not in load_driver(parsed.scheme).options or "seed" in parsed.options:
        return url
    return f"{url}{'&' if '?' in url else '?'}seed={seed}"


def seed_of(url: str) -> int | None:
    """Return the random seed in an emulated rig's URL; None for a URL without a seed."""
    parsed = parse_url(url)
    if "seed" not in load_driver(parsed.scheme).options:
        return None
    given = parsed.one("seed")
    return int(given) if given is not None and given.isdecimal() else None


def find_rigs() -> Iterator[tuple[str, list[str], str | None]]:
    """Find the connected rigs; yield for each driver (URL scheme, device URLs, error or None)."""
    for scheme in sorted(registered()):
        urls, problem = list[str](), None
        try:
            found = load_driver(scheme).find()
            if isinstance(found, str):
                raise TypeError(f"find() returned the text {found!r}, not a sequence of URLs")
            urls = [parse_url(url).text for url in found]
        except (Exception, SystemExit) as error:  # a faulty driver hides no other driver's rigs
            urls, problem = [], str(error)
        yield scheme, urls, problem


MOCK = "mock:"
"""URL of the emulated rig"""


def default_device() -> str:
    """Return the URL in the environment variable `DEVICE_VARIABLE`; if unset, `found_device`."""
    return os.environ.get(DEVICE_VARIABLE) or found_device()


def found_device() -> str:
    """Return the real rig's URL if exactly one is found, `MOCK` (the emulated rig) if none is.

    Raises UsageError if several real rigs are found.
    """
    real = [url for _, urls, _ in find_rigs() for url in urls if not is_private(url)]
    if len(real) > 1:
        raise UsageError(
            f"Several rigs were found: {', '.join(real)}.",
            cause="no device was given.",
            fix=f"--device {quoted(real[0])}, or export {DEVICE_VARIABLE}={quoted(real[0])}",
        )
    return real[0] if real else MOCK
