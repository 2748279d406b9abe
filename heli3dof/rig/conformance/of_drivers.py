"""What a driver owes before and beside an open rig: names, lists, errors, an emergency stop."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import TypeVar

from heli3dof.errors import DeviceError, UsageError
from heli3dof.rig.drivers import open_rig
from heli3dof.rig.interface import Flags
from heli3dof.rig.url import parse_url

from .bench import Bench, cases, owed, owed_error, owed_rest, owed_volts

T = TypeVar("T")
QUICK_S = 1.0
"""s that a look at the doors may take"""
LOOKS = 3
"""A first one may have a library to import, on a machine that has other work as well."""


def _looked(look: Callable[[], Iterable[T]]) -> tuple[list[T], float]:
    """What is found, and the s that it took: of the first look that was quick, or the last."""
    for _ in range(LOOKS):
        start = time.monotonic()
        found = list(look())
        took = time.monotonic() - start
        if took < QUICK_S:
            break
    return found, took


def a_driver_finds_its_rigs_in_no_time_by_urls_of_its_scheme(bench: Bench) -> None:
    driver = bench.driver
    found, took = _looked(driver.find)
    owed(took < QUICK_S, f"find() within {QUICK_S:g} s", f"{took:.2f} s")
    for url in found:
        owed(parse_url(url).scheme == driver.scheme, f"{driver.scheme}: before every URL", url)


def an_option_that_it_does_not_know_is_an_error_that_names_those_it_knows(bench: Bench) -> None:
    scheme = bench.driver.scheme
    try:
        open_rig(f"{scheme}:?no_such_option=1", bench.profile).close()
    except UsageError as problem:
        missing = [o for o in bench.driver.options if o not in str(problem)]
        owed(not missing, "every option named in the error", f"without {missing}: {problem}")
        return
    owed(False, "a UsageError for an unknown option", "it was taken")


def what_is_examined_before_opening_says_what_mends_it(bench: Bench) -> None:
    for when in ("of a rig that is closed", "of a rig that is open"):
        if when.endswith("open"):
            bench.open()
        found, took = _looked(lambda: bench.driver.examine(parse_url(bench.url)))
        for check in found:
            owed(check.what and check.found, f"what was looked at and found, {when}", check)
            owed(check.good is not False or check.fix, f"what mends it, {when}", check)
        owed(took < QUICK_S, f"examine() within {QUICK_S:g} s {when}", f"{took:.2f} s")


def a_rig_that_is_open_is_busy_and_goes_on_undisturbed(bench: Bench) -> None:
    host = bench.open_to_move()
    if bench.private:
        bench.open()
        return
    host.arm()
    host.send(2.0, 2.0)
    try:
        open_rig(bench.url, bench.profile).close()
    except DeviceError as problem:
        owed(problem.fix, "an error that says what to do when the rig is busy", problem)
    else:
        owed(False, "a DeviceError where another holds the rig", "it was opened twice")
    host.arm()
    owed_volts(host.hold(2.0, 2.0), 2.0, 2.0, "after another tried to open the rig")


def a_closed_rig_can_be_opened_again_and_is_at_rest(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    host.send(3.0, 3.0)
    host.rig.close()
    again = bench.open()
    owed_rest(again.rig.read(), "of a rig that was closed and opened again")
    owed(again.arm().flags == Flags.ENABLED, "a rig that can be armed again", again.rig.read())


def the_drivers_stop_reaches_a_rig_that_another_holds(bench: Bench) -> None:
    host = bench.open_to_move()
    host.arm()
    host.send(3.0, 3.0)
    try:
        said = bench.driver.estop(parse_url(bench.url))
    except DeviceError as problem:
        # A door that lets nobody past its holder must say so, and what else stops the rig.
        owed(problem.fix, "an error that says what else stops the rig", problem)
        return
    owed(said, "words for what was done", repr(said))
    if bench.private:
        return
    host.send(3.0, 3.0)
    sample = host.send(3.0, 3.0)
    owed_rest(sample, "after the driver's own stop")
    owed(sample.flags & Flags.ESTOP, "ESTOP in the holder's samples", sample.flags)


def a_stop_of_a_rig_that_is_not_there_is_an_error(bench: Bench) -> None:
    url = parse_url(f"{bench.driver.scheme}://no-such-place")
    if bench.private:
        return
    owed_error(lambda: bench.driver.estop(url), "for a stop of a rig that is not there")


CASES = cases(
    a_driver_finds_its_rigs_in_no_time_by_urls_of_its_scheme,
    an_option_that_it_does_not_know_is_an_error_that_names_those_it_knows,
    what_is_examined_before_opening_says_what_mends_it,
    a_rig_that_is_open_is_busy_and_goes_on_undisturbed,
    a_closed_rig_can_be_opened_again_and_is_at_rest,
    the_drivers_stop_reaches_a_rig_that_another_holds,
    a_stop_of_a_rig_that_is_not_there_is_an_error,
)
