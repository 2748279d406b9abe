"""Stops rigs now, whichever process holds them.

A session is a process that uses a rig. An emergency stop of one rig or of all rigs has three steps:

1. Store the time of the stop (`stop_stamp`). A program that was started before this time cannot arm
   the rig any more.
2. Send a stop request to the socket of each session of these rigs. The session stops its rig and
   confirms this. If the session of a real rig does not answer within 200 ms, the rig's driver stops
   the device, although the session's process holds it.
3. If a rig has no session, its driver stops the device.

In step 2, the program sends all requests before it reads any answer. So a session that hangs does
not delay the stop of another session.

A stop of all rigs includes the rigs that a driver finds and the rigs that were opened earlier. In
step 3, the program stops them simultaneously, with one thread for each rig. The program sends
nothing to a port at which no rig is known (`heli3dof.rig.session.known_devices`), because another
instrument may be there.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from heli3dof.errors import DeviceError, Heli3dofError, UsageError, quoted
from heli3dof.rig.drivers import check_url, find_rigs, is_private, load_driver
from heli3dof.rig.session.client import Request, recorded_sessions
from heli3dof.rig.session.known_devices import is_known, remembered, serials_at
from heli3dof.rig.session.locks import is_held
from heli3dof.rig.session.paths import device_name
from heli3dof.rig.session.stop_stamp import ALL, leave_stamp, names_of
from heli3dof.rig.url import parse_url

PATIENCE_S = 0.2
"""s within which a session must confirm; it needs a control period and a round trip"""


@dataclass(frozen=True, slots=True)
class Stopped:
    """The result of an emergency stop for one rig."""

    device: str
    done: bool
    how: str
    """What was done, or why it failed"""
    seconds: float
    """s from the request of the stop to its confirmation"""
    held: bool
    """True if a session held the rig; False: a driver found the device, which may be no rig"""


def request_estop(device: str | None, reason: str) -> EstopResult:
    """Stop the rig at the URL ``device``, or every rig if None; return one result per device.

    A failed stop raises no error; ``unconfirmed`` lists it. An invalid URL raises UsageError.
    ``skipped`` lists the ports that a driver found but at which no rig is known (`is_known`):
    nothing is sent to them, since they may belong to other instruments. ``reason`` is stored in the
    recording of the flight that the stop ends.
    """
    if device is not None:
        check_url(device)
    start = time.monotonic()
    try:
        with suppress(OSError):  # e.g. a full disk: running sessions can still be stopped
            leave_stamp([ALL] if device is None else names_of(device, serials_at(device)), reason)
        sessions = recorded_sessions(device)
    except DeviceError:
        # The folder is another user's, so it shows no sessions; devices can still be stopped.
        sessions = []
    requests = [Request(s, {"do": "estop", "reason": reason}) for s in sessions]
    alive = [request for request in requests if request.accepted]
    results = [stopped for each in alive if (stopped := _await(each, start)) is not None]
    skipped: list[str] = []
    if device is None:
        held = {device_name(request.session.device) for request in alive}
        found_now = [url for _, urls, problem in find_rigs() if problem is None for url in urls]
        # A remembered URL replaces a found one: it has the options that the device needs.
        free = {device_name(u): u for u in (*found_now, *remembered()) if _may_be_real(u)}
        known: list[str] = []
        for name, url in free.items():
            if name not in held:
                (known if is_known(url) else skipped).append(url)
        results += _all_directly(known, start)
    elif not results and not is_private(device):
        results = [_directly(device, start)]
    return EstopResult([s for s in results if s.done], [s for s in results if not s.done], skipped)


def _may_be_real(url: str) -> bool:
    """Return False for an emulated rig; True if the URL's driver cannot be loaded."""
    try:
        return not is_private(url)
    except Heli3dofError:
        return True


def _await(request: Request, start: float) -> Stopped | None:
    """Wait for a session's answer to a stop request, and return the result.

    Without an answer, the driver stops a real rig directly. An emulated rig exists only in the
    session's process. If this process has ended without an answer, nothing is left to stop, and the
    result is None. ``start``: when the stop began, in s (monotonic).
    """
    session = request.session
    who = f"pid {session.pid} (`{session.doing}`)"
    answer = request.answer(PATIENCE_S) or {}
    if "stopped" in answer:
        how = f"{who} stopped it {answer['stopped']}"
        return Stopped(session.device, True, how, time.monotonic() - start, True)
    if session.private:
        if "over" in answer:
            how = f"{who} had just ended, and its emulated rig with it"
            return Stopped(session.device, True, how, time.monotonic() - start, True)
        if not is_held(session.lock):
            return None
        how = f"{who} does not answer and holds the emulated rig: end that process"
        return Stopped(session.device, False, how, time.monotonic() - start, True)
    after = "had just ended" if "over" in answer else "did not answer"
    direct = _directly(session.device, start)
    return replace(direct, how=f"{who} {after}; {direct.how}", held=True)


def _all_directly(devices: Sequence[str], start: float) -> list[Stopped]:
    """Stop each device through its driver, in a thread per device; return the results.

    So an unreachable device, which fails after seconds, delays no other.
    """
    results: dict[str, Stopped] = {}

    def stop(device: str) -> None:
        try:
            results[device] = _directly(device, start)
        except UsageError as problem:
            results[device] = Stopped(device, False, problem.what, time.monotonic() - start, False)

    threads = [threading.Thread(target=stop, args=(each,), daemon=True) for each in devices]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return [results[device] for device in devices]


def _directly(device: str, start: float) -> Stopped:
    url = parse_url(device)
    try:
        how, done = load_driver(url.scheme).estop(url), True
    except UsageError:
        raise
    except Heli3dofError as problem:
        how, done = problem.what, False
    except (Exception, SystemExit) as problem:
        how, done = f"{type(problem).__name__}: {problem}", False
    return Stopped(device, done, how, time.monotonic() - start, held=False)


@dataclass(frozen=True)
class EstopResult:
    """The result of an emergency stop: one result per rig, and the URLs that got no stop request.

    These URLs are ports at which no rig is known. Another instrument may be there.
    """

    stopped: list[Stopped]
    unconfirmed: list[Stopped]
    """Results of the devices that did not confirm the stop"""
    skipped: list[str]
    """URLs of ports at which no rig is known: nothing was sent to them"""

    def raise_if_not_stopped(self, device: str | None = None) -> None:
        """Raise DeviceError if the stop failed; ``device``: the rig's URL, None for all rigs.

        The stop failed in these cases:

        - No rig was stopped.
        - The rig at the URL ``device`` did not confirm its stop.
        - ``device`` is None, and a rig that a process uses did not confirm its stop.

        If ``device`` is None, a device that no process uses need not confirm: it may be no rig.
        """
        failed = self.unconfirmed
        if not self.stopped and not failed and self.skipped:
            raise DeviceError(
                "No rig was stopped: no flight runs, and no rig was ever opened at "
                f"{', '.join(self.skipped)}.",
                cause="these ports may belong to other instruments, so nothing was sent. A "
                "flight that was starting before now will not arm.",
                fix=" && ".join(f"heli3dof estop --device {quoted(url)}" for url in self.skipped)
                + "; or switch off the amplifier",
            )
        if not self.stopped and not failed:
            raise DeviceError(
                "No rig was stopped: no flight runs, and no rig was found"
                + (f" at {device}." if device else "."),
                cause="the rig is in another user's session, or is not plugged in. A flight of "
                "yours that was starting before now will not arm.",
                fix="switch off the amplifier; heli3dof devices lists the rigs in reach",
            )
        if failed and (device or not self.stopped or any(s.held for s in failed)):
            raise DeviceError(
                "NOT STOPPED: " + "; ".join(f"{s.device}: {s.how}" for s in failed),
                cause="the cable is out, the device hangs, or you may not open the port.",
                fix="switch off the amplifier. Without commands, its watchdog stops it",
            )


def estop(device: str | None = None, reason: str = "heli3dof.estop()") -> EstopResult:
    """Set the rig at the URL ``device`` to zero volts now, even while a process flies it.

    ``device``: None stops every rig that is in use or found. ``reason`` is stored in the recording
    of the flight that the stop ends. Raises DeviceError if no rig was stopped or a rig did not
    confirm (`EstopResult.raise_if_not_stopped`).
    """
    result = request_estop(device, reason)
    result.raise_if_not_stopped(device)
    return result
