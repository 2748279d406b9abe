"""Stop rigs now, whatever holds them.

    first                →  a stamp: what was begun before it does not arm (`stop_stamp`)
    session that runs    →  asked through its socket; it confirms once the device has stopped
    no answer in 200 ms  →  directly: the driver speaks to the device past its holder
    no session           →  directly

All sessions are asked before any answer is awaited: a hung one delays no other. Rigs without a
session come after them, all at once, since nothing of ours moves them: those that a driver finds
and those at places where one was opened before. A place that is not known for a rig's
(`heli3dof.rig.session.known_devices`) is left out, for it may be another instrument.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from heli3dof.errors import DeviceError, Heli3dofError, UsageError
from heli3dof.rig.drivers import find_rigs, is_private, load_driver
from heli3dof.rig.session.client import Question, listed
from heli3dof.rig.session.known_devices import is_known, remembered, serials_at
from heli3dof.rig.session.locks import is_held
from heli3dof.rig.session.paths import device_name
from heli3dof.rig.session.stop_stamp import ALL, leave_stamp, names_of
from heli3dof.rig.url import parse_url

PATIENCE_S = 0.2
"""s that a session has to confirm; it needs a control period and a round trip"""


@dataclass(frozen=True, slots=True)
class Stopped:
    """One rig that was to be stopped, and what became of it."""

    device: str
    done: bool
    how: str
    """What was done, or why it could not be"""
    seconds: float
    """s from the command to the confirmation"""
    held: bool
    """A session of ours held it; else it was only found, and need not even be a rig"""


def stop_rigs(device: str | None, reason: str) -> tuple[list[Stopped], list[str]]:
    """Stop one device, or every running session and every rig that is found: (rigs, left out).

    ``left out``: URLs of what was found and may be no rig. Raises UsageError for a URL that makes
    no sense; never DeviceError: that is in the answer.
    """
    if device is not None:
        parsed = parse_url(device)
        parsed.check_options(load_driver(parsed.scheme).options)
    start = time.monotonic()
    try:
        with suppress(OSError):  # a full disk, say: what flies can still be stopped
            leave_stamp([ALL] if device is None else names_of(device, serials_at(device)), reason)
        sessions = listed(device)
    except DeviceError:
        # Sessions cannot be told from a stranger's folder; the devices still can be stopped.
        sessions = []
    asked = [Question(s, {"do": "estop", "reason": reason}) for s in sessions]
    questions = [q for q in asked if q.taken]
    found = [stopped for q in questions if (stopped := _await(q, start)) is not None]
    if device is not None:
        if not found and not is_private(device):
            found = [_directly(device, start)]
        return found, []
    held = {device_name(q.session.device) for q in questions}
    found_now = [url for _, urls, problem in find_rigs() if problem is None for url in urls]
    # What was opened before comes last: its URL has the options that the device needs.
    free = {device_name(u): u for u in (*found_now, *remembered()) if not is_private(u)}
    known: list[str] = []
    left_out: list[str] = []
    for name, url in free.items():
        if name not in held:
            (known if is_known(url) else left_out).append(url)
    return found + _all_directly(known, start), left_out


def _await(question: Question, start: float) -> Stopped | None:
    """What became of a session's rig; None where the session was one no longer."""
    session = question.session
    who = f"pid {session.pid} (`{session.doing}`)"
    answer = question.answer(PATIENCE_S) or {}
    if "stopped" in answer:
        how = f"{who} stopped it {answer['stopped']}"
        return Stopped(session.device, True, how, time.monotonic() - start, True)
    if session.private:
        if "over" in answer:
            how = f"{who} had just ended, and its emulated rig with it"
            return Stopped(session.device, True, how, time.monotonic() - start, True)
        if not is_held(session.lock):
            return None
        how = f"{who} does not answer, and holds the emulated rig inside it: end that process"
        return Stopped(session.device, False, how, time.monotonic() - start, True)
    after = "had just ended" if "over" in answer else "did not answer"
    direct = _directly(session.device, start)
    return replace(direct, how=f"{who} {after}; {direct.how}", held=True)


def _all_directly(devices: Sequence[str], start: float) -> list[Stopped]:
    """Each in a thread of its own: a host that is out of reach takes seconds to say so."""
    found: dict[str, Stopped] = {}

    def stop(device: str) -> None:
        try:
            found[device] = _directly(device, start)
        except UsageError as problem:
            found[device] = Stopped(device, False, problem.what, time.monotonic() - start, False)

    threads = [threading.Thread(target=stop, args=(each,), daemon=True) for each in devices]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return [found[device] for device in devices]


def _directly(device: str, start: float) -> Stopped:
    url = parse_url(device)
    try:
        how, done = load_driver(url.scheme).estop(url), True
    except UsageError:
        raise
    except Heli3dofError as problem:
        how, done = problem.what, False
    except Exception as problem:
        how, done = f"{type(problem).__name__}: {problem}", False
    return Stopped(device, done, how, time.monotonic() - start, held=False)
