"""Reach the sessions that run now, from another process: list them, ask for a stop or the state.

Who is there is told by the lock files; a session lives where its socket takes a connection (a
process that hangs still does, one that was killed does not).
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

from heli3dof.rig.places import POSSIBLE, device_name, runtime_folder

LONGEST_ANSWER = 1 << 16


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
    socket: Path


def running(device: str | None = None) -> list[Running]:
    """The sessions that run now, or those on one device; `mock:` means every emulated rig."""
    if not POSSIBLE:
        return []
    folder = runtime_folder()
    pattern = "*.lock" if device is None else f"{device_name(device)}*.lock"
    found = []
    for lock in sorted(folder.glob(pattern)):
        path = lock.with_suffix(".sock")
        try:
            about = json.loads(lock.read_bytes())
            session = Running(
                about["device"], about["pid"], about["doing"], about["since_utc"],
                about["private"], path,
            )  # fmt: skip
        except (OSError, ValueError, KeyError, TypeError):
            continue
        if lives(session):
            found.append(session)
        elif session.private:
            # A private name is never used again: what a killed process left is swept away.
            for left in (lock, path):
                left.unlink(missing_ok=True)
    return found


class Question:
    """A question that is on its way to a session; several may be, before any is answered."""

    def __init__(self, session: Running, question: Mapping[str, Any]) -> None:
        self.session = session
        self.asked_s = time.monotonic()
        self._line: socket.socket | None = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._line.setblocking(False)
        try:
            self._line.connect(str(session.socket))
            if question:
                self._line.sendall(json.dumps(question).encode() + b"\n")
        except OSError:
            self._line.close()
            self._line = None

    def answer(self, timeout_s: float) -> dict[str, Any] | None:
        """What it says within ``timeout_s`` of the question, or None: it does not answer."""
        if self._line is None:
            return None
        text = b""
        try:
            while not text.endswith(b"\n"):
                left = self.asked_s + timeout_s - time.monotonic()
                self._line.settimeout(max(left, 1e-3))
                piece = self._line.recv(LONGEST_ANSWER)
                if not piece:
                    return None
                text += piece
            answer = json.loads(text)
        except (OSError, ValueError):
            return None
        finally:
            self.close()
        return answer if isinstance(answer, dict) else None

    def close(self) -> bool:
        """Hang up. True where the session had taken the connection."""
        taken = self._line is not None
        with contextlib.suppress(OSError):
            if self._line is not None:
                self._line.close()
        return taken


def lives(session: Running) -> bool:
    """True where it still takes connections; one that hangs does, and answers nothing."""
    return Question(session, {}).close()


def state(session: Running, timeout_s: float = 0.2) -> dict[str, Any] | None:
    """What a session says of its rig now, or None where it does not answer."""
    answer = Question(session, {"do": "state"}).answer(timeout_s)
    found = None if answer is None else answer.get("state")
    return found if isinstance(found, dict) else None
