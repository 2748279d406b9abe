"""Reach the sessions that run now, from another process: list them, ask for a stop or the state.

The locks' holder files name the sessions; one lives where its socket takes a connection (a process
that hangs still does, one that was killed does not).
"""

from __future__ import annotations

import contextlib
import json
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from heli3dof.rig.session.locks import HOLDER, holder_path, is_held, read_holder
from heli3dof.rig.session.paths import device_name, runtime_folder

LONGEST_ANSWER = 1 << 16
CONNECT_S = 0.2
"""s that the system may take for a connection within this computer"""


@dataclass(frozen=True, slots=True)
class Running:
    """A session of this user that takes connections now."""

    device: str
    """The URL that it opened"""
    pid: int
    doing: str
    """Its command line"""
    since_utc: str
    private: bool
    """The rig lives inside that process"""
    port: int
    key: str
    lock: Path


def listed(device: str | None = None) -> list[Running]:
    """The sessions on record, or those on one device; one that was killed is still among them."""
    pattern = "*.lock" if device is None else f"{device_name(device)}*.lock"
    found = []
    for holder in sorted(runtime_folder().glob(pattern + HOLDER)):
        lock = holder.with_name(holder.name.removesuffix(HOLDER))
        with contextlib.suppress(TypeError):
            found.append(Running(**read_holder(lock), lock=lock))
    return found


def running(device: str | None = None) -> list[Running]:
    """The sessions that run now, or those on one device; `mock:` means every emulated rig."""
    found = []
    for session in listed(device):
        if lives(session):
            found.append(session)
        elif session.private:
            # A private name is never used again: what a killed process left is swept away.
            for left in (session.lock, holder_path(session.lock)):
                with contextlib.suppress(OSError):
                    left.unlink()
    return found


class Question:
    """A question that is on its way to a session; several may be, before any is answered."""

    def __init__(self, session: Running, question: Mapping[str, Any]) -> None:
        self.session = session
        self.asked_s = time.monotonic()
        self.timed_out = False
        self._line: socket.socket | None = None
        try:
            self._line = socket.create_connection(("127.0.0.1", session.port), CONNECT_S)
            if question:
                text = json.dumps({"key": session.key, **question})
                self._line.sendall(text.encode() + b"\n")
        except TimeoutError:
            self.timed_out = True
        except OSError:  # refused: the process is gone
            self.close()

    def answer(self, timeout_s: float) -> dict[str, Any] | None:
        """What it says within ``timeout_s`` of the question, or None: it does not answer."""
        line = self._line
        if line is None:
            return None
        text = b""
        try:
            while not text.endswith(b"\n"):
                left = self.asked_s + timeout_s - time.monotonic()
                line.settimeout(max(left, 1e-3))
                piece = line.recv(LONGEST_ANSWER)
                if not piece:
                    return None
                text += piece
            answer = json.loads(text)
        except (OSError, ValueError):
            return None
        finally:
            self.close()
        return answer if isinstance(answer, dict) else None

    @property
    def taken(self) -> bool:
        """Whether the session has taken the connection; one that hangs does, and answers nothing.

        Windows takes seconds to refuse one, and a process that hangs for long takes no more: there
        its lock says whether it lives.
        """
        return self._line is not None or (self.timed_out and is_held(self.session.lock))

    def close(self) -> None:
        """Hang up. Idempotent."""
        line, self._line = self._line, None
        if line is not None:
            line.close()


def lives(session: Running) -> bool:
    """True where it still takes connections."""
    question = Question(session, {})
    taken = question.taken
    question.close()
    return taken


def state(session: Running, timeout_s: float = 0.2) -> dict[str, Any] | None:
    """What a session says of its rig now, or None where it does not answer."""
    answer = Question(session, {"do": "state"}).answer(timeout_s)
    found = None if answer is None else answer.get("state")
    return found if isinstance(found, dict) else None
