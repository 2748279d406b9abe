"""Test cases for a driver: finding rigs, URL options, checks, opening, emergency stop."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import TypeVar

from heli3dof.errors import DeviceError, Heli3dofError, UsageError
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.interface import Flags
from heli3dof.rig.url import parse_url

from .bench import Bench, cases, require, require_error, require_rest, require_volts

T = TypeVar("T")
QUICK_S = 1.0
"""s within which `Driver.find` and `Driver.examine` must return"""
TRIES = 3
"""Calls that are timed: on a busy computer the first may be slow, as it imports a library"""


def _timed(call: Callable[[], Iterable[T]]) -> tuple[list[T], float]:
    """Repeat ``call`` until it takes less than `QUICK_S` s; return its result and its time in s.

    A busy computer may delay some calls, so there are up to `TRIES` calls; the last call counts.
    """
    for _ in range(TRIES):
        start = time.monotonic()
        found = list(call())
        took = time.monotonic() - start
        if took < QUICK_S:
            break
    return found, took


def find_returns_urls_of_the_drivers_scheme_within_a_second(bench: Bench) -> None:
    driver = bench.driver
    found, took = _timed(driver.find)
    require(took < QUICK_S, f"find() within {QUICK_S:g} s", f"{took:.2f} s")
    for url in found:
        require(
            parse_url(url).scheme == driver.scheme, f"URLs that begin with {driver.scheme}:", url
        )


def an_unknown_option_is_an_error_that_names_the_known_ones(bench: Bench) -> None:
    scheme = bench.driver.scheme
    try:
        open_driver(f"{scheme}:?no_such_option=1", bench.profile).close()
    except UsageError as problem:
        missing = [o for o in bench.driver.options if o not in str(problem)]
        require(not missing, "every option named in the error", f"without {missing}: {problem}")
        return
    require(False, "a UsageError for an unknown option", "it was accepted")


def a_failed_check_before_opening_names_its_fix(bench: Bench) -> None:
    for when in ("of a rig that is closed", "of a rig that is open"):
        if when.endswith("open"):
            bench.open()
        found, took = _timed(lambda: bench.driver.examine(parse_url(bench.url)))
        for check in found:
            require(check.what and check.found, f"checks with what and found, {when}", check)
            require(
                check.good is not False or check.fix, f"a fix for every failed check, {when}", check
            )
        require(took < QUICK_S, f"examine() within {QUICK_S:g} s {when}", f"{took:.2f} s")


def opening_an_open_rig_fails_and_does_not_disturb_it(bench: Bench) -> None:
    host = bench.open_to_move()
    if bench.private:
        bench.open()
        return
    host.arm()
    host.send(2.0, 2.0)
    try:
        open_driver(bench.url, bench.profile).close()
    except DeviceError as problem:
        require(problem.fix, "an error with a fix when the rig is busy", problem)
    else:
        require(False, "a DeviceError where the rig is open already", "it was opened twice")
    host.arm()
    require_volts(host.hold(2.0, 2.0), 2.0, 2.0, "after a second attempt to open the rig")


def a_closed_rig_can_be_opened_again_at_zero_volts(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    host.send(3.0, 3.0)
    host.rig.close()
    again = bench.open()
    require_rest(again.rig.read(), "after closing and opening again")
    require(again.arm().flags == Flags.ENABLED, "a rig that can be armed again", again.rig.read())


def the_drivers_estop_stops_a_rig_that_is_open_elsewhere(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    host.send(3.0, 3.0)
    try:
        report = bench.driver.estop(parse_url(bench.url))
    except DeviceError as problem:
        # A port that only one program can open: the error must state what else stops the rig.
        require(problem.fix, "an error that states what else stops the rig", problem)
        return
    require(report, "a report of what was done", repr(report))
    if bench.private:
        return
    host.send(3.0, 3.0)
    sample = host.send(3.0, 3.0)
    require_rest(sample, "after the driver's estop")
    require(sample.flags & Flags.ESTOP, "ESTOP in the samples of the open rig", sample.flags)


def the_drivers_estop_of_a_missing_rig_is_an_error(bench: Bench) -> None:
    url = parse_url(f"{bench.driver.scheme}://no-such-place")
    if bench.private:
        return
    # A UsageError, where no rig of the scheme can have this address.
    require_error(lambda: bench.driver.estop(url), "for a stop of a missing rig", Heli3dofError)


CASES = cases(
    find_returns_urls_of_the_drivers_scheme_within_a_second,
    an_unknown_option_is_an_error_that_names_the_known_ones,
    a_failed_check_before_opening_names_its_fix,
    opening_an_open_rig_fails_and_does_not_disturb_it,
    a_closed_rig_can_be_opened_again_at_zero_volts,
    the_drivers_estop_stops_a_rig_that_is_open_elsewhere,
    the_drivers_estop_of_a_missing_rig_is_an_error,
)
