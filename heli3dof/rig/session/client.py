"""Lists the running sessions of other processes; requests a stop or the rig's state from them.

A session is a process that uses a rig. It describes itself in the holder file of its lock
(`heli3dof.rig.session.locks`). A session is alive if its socket accepts a connection. The socket of
a hanging process accepts connections, the socket of a killed process does not.
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
"""s within which a connection to a process of this computer must succeed"""


@dataclass(frozen=True, slots=True)
class Running:
    """A session: a process of the current user that has locked a rig and uses it.

    The process writes these attributes, except ``lock``, to a file next to the lock's file.
    """

    device: str
    """URL of the rig that the process opened"""
    pid: int
    doing: str
    """What the process does, by default its command line"""
    since_utc: str
    private: bool
    """True if the rig is emulated inside that process"""
    port: int
    """TCP port of the session's socket on this computer"""
    key: str
    """Secret that a request must contain"""
    lock: Path
    """The lock's file"""


def recorded_sessions(device: str | None = None) -> list[Running]:
    """Return every session that has a lock file, even if its process was killed.

    ``device``: URL of the rig that the sessions use; None: any rig.
    """
    pattern = "*.lock" if device is None else f"{device_name(device)}*.lock"
    sessions = []
    for holder in sorted(runtime_folder().glob(pattern + HOLDER)):
        lock = holder.with_name(holder.name.removesuffix(HOLDER))
        with contextlib.suppress(TypeError):
            sessions.append(Running(**read_holder(lock), lock=lock))
    return sessions


def running(device: str | None = None) -> list[Running]:
    """Return the running sessions; delete the files of killed sessions of emulated rigs.

    ``device``: URL of the rig that the sessions use; None: any rig; ``mock:``: any emulated rig.
    """
    alive = []
    for session in recorded_sessions(device):
        if lives(session):
            alive.append(session)
        elif session.private:
            # The name of a private session is never used again: delete a killed one's files.
            for left in (session.lock, holder_path(session.lock)):
                with contextlib.suppress(OSError):
                    left.unlink()
    return alive


class Request:
    """A request to a session (a process that uses a rig). The constructor sends the request.

    ``content``: the request's JSON keys and values; the constructor adds the session's secret key.
    If ``content`` is empty, the constructor only connects to the session.
    """

    def __init__(self, session: Running, content: Mapping[str, Any]) -> None:
        self.session = session
        self.sent_s = time.monotonic()
        self.timed_out = False
        self._line: socket.socket | None = None
        try:
            self._line = socket.create_connection(("127.0.0.1", session.port), CONNECT_S)
            if content:
                text = json.dumps({"key": session.key, **content})
                self._line.sendall(text.encode() + b"\n")
        except TimeoutError:
            self.timed_out = True
        except OSError:  # refused: the process is gone
            self.close()

    def answer(self, timeout_s: float) -> dict[str, Any] | None:
        """Return the session's answer; None if none comes within ``timeout_s`` of the request."""
        line = self._line
        if line is None:
            return None
        text = b""
        try:
            while not text.endswith(b"\n"):
                left = self.sent_s + timeout_s - time.monotonic()
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
    def accepted(self) -> bool:
        """Return True if the session is alive: it accepted the connection or holds its lock.

        The lock is checked only after a timeout, because a timeout does not show that the process
        has ended. For a hanging process the system accepts only a limited number of connections,
        and Windows takes seconds to refuse a connection.
        """
        return self._line is not None or (self.timed_out and is_held(self.session.lock))

    def close(self) -> None:
        """Close the connection. Idempotent."""
        line, self._line = self._line, None
        if line is not None:
            line.close()


def lives(session: Running) -> bool:
    """Return True if the session's process is alive, even if it hangs."""
    request = Request(session, {})
    accepted = request.accepted
    request.close()
    return accepted


def state(session: Running, timeout_s: float = 0.2) -> dict[str, Any] | None:
    """Return the state of a session's rig; None if no answer comes within ``timeout_s`` s."""
    answer = Request(session, {"do": "state"}).answer(timeout_s)
    content = None if answer is None else answer.get("state")
    return content if isinstance(content, dict) else None
