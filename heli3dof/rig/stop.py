"""Stop rigs now, whoever holds them.

    session that runs   →  asked through its socket; it confirms once the device has stopped
    no answer in 200 ms →  directly: the driver speaks to the device past whoever holds it
    no session          →  directly

All sessions are asked before any answer is awaited: a hung one delays nobody. Whoever is found
without a session comes after them, since nothing of ours moves it; what is not known for a rig's
place (`heli3dof.rig.known`) is left out, for it may be another instrument.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

from heli3dof.errors import DeviceError, Heli3dofError, UsageError
from heli3dof.rig.attach import Question, running
from heli3dof.rig.drivers import find_rigs, is_private, load_driver
from heli3dof.rig.known import is_known
from heli3dof.rig.places import device_name
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
        load_driver(parse_url(device).scheme)
    start = time.monotonic()
    try:
        sessions = running(device)
    except DeviceError:
        # Sessions cannot be told from a stranger's folder; the devices still can be stopped.
        sessions = []
    questions = [Question(s, {"do": "estop", "reason": reason}) for s in sessions]
    held = {device_name(q.session.device) for q in questions}
    found = [_await(q, start) for q in questions]
    if device is not None:
        if not found and not is_private(device):
            found = [_directly(device, start, held=False)]
        return found, []
    left_out = []
    for _scheme, urls, problem in find_rigs():
        if problem is not None:
            continue
        for url in urls:
            if device_name(url) in held or is_private(url):
                continue
            if is_known(url):
                found.append(_directly(url, start, held=False))
            else:
                left_out.append(url)
    return found, left_out


def _await(question: Question, start: float) -> Stopped:
    session = question.session
    who = f"pid {session.pid} (`{session.doing}`)"
    answer = question.answer(PATIENCE_S) or {}
    if "stopped" in answer:
        return Stopped(session.device, True, f"{who} stopped it", time.monotonic() - start, True)
    if session.private:
        if "over" in answer:
            how = f"{who} had just ended, and its emulated rig with it"
            return Stopped(session.device, True, how, time.monotonic() - start, True)
        how = f"{who} does not answer, and holds the emulated rig inside it: kill {session.pid}"
        return Stopped(session.device, False, how, time.monotonic() - start, True)
    direct = _directly(session.device, start, held=True)
    after = "had just ended" if "over" in answer else "did not answer"
    return replace(direct, how=f"{who} {after}; {direct.how}")


def _directly(device: str, start: float, *, held: bool) -> Stopped:
    url = parse_url(device)
    try:
        how, done = load_driver(url.scheme).estop(url), True
    except UsageError:
        raise
    except Heli3dofError as problem:
        how, done = problem.what, False
    except Exception as problem:
        how, done = f"{type(problem).__name__}: {problem}", False
    return Stopped(device, done, how, time.monotonic() - start, held)
