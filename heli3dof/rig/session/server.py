"""`Session`: locks the rig that a process uses, and lets other processes stop or observe it.

A session holds two locks (`heli3dof.rig.session.locks`): one on the rig's port, and one on the
device, once the device is identified.

The session listens on a TCP socket at 127.0.0.1. It writes the socket's TCP port and a secret key
to a file next to the lock (the lock's *holder file*), which only this user's processes can read. In
each connection a client sends one request and receives one answer. Both are one line of JSON:

    {"key": "…", "do": "estop", "reason": "…"}   answered when the rig has been stopped
    {"key": "…", "do": "state"}                  answered with what `Session.state` returns

A thread of the session answers the requests; it sleeps until a request comes. This thread does not
use the rig. The control loop reads `Session.stop_reason` in every period, and stops the rig if a
reason is set (`heli3dof.rig.session.stoppable_rig`).

An emulated rig is private to its process. So the name of its port's lock contains the process
identifier, and it has no device lock.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import selectors
import socket
import sys
import threading
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from heli3dof.rig.interface import Identity
from heli3dof.rig.session.locks import Lock, device_lock_path
from heli3dof.rig.session.paths import device_name, runtime_folder
from heli3dof.rig.session.stop_stamp import command_began_ns, names_of, stopped_since

LONGEST_REQUEST = 4096
PATIENCE_S = 1.0
"""s that a client may take to send its request"""
BACKLOG = 128
"""Connections that the system accepts while this process hangs: enough for 12 s of
``heli3dof monitor``"""
MOST_CLIENTS = 64
"""Largest number of connections without a request yet; any user of the computer can open them"""
_number = itertools.count()


class Session:
    """One process's lock on one rig. Close it, or use it in a ``with`` statement.

    ``device``: the rig's URL. ``private``: True if the rig is emulated in this process. ``doing``:
    what the session does, for messages. ``began_ns``: a time in ns on the monotonic clock. If an
    emergency stop came after this time, the rig cannot be armed. The default, usually the start of
    this program, is the result of `heli3dof.rig.session.stop_stamp.command_began_ns`.

    Raises DeviceError if another session holds the rig. The error names the other session.
    """

    def __init__(
        self, device: str, *, private: bool = False, doing: str | None = None,
        began_ns: int | None = None,
    ) -> None:  # fmt: skip
        self.device, self.private = device, private
        self.stop_reason: str | None = None
        """Reason of a requested emergency stop; None: none was requested"""
        self.stopped: str | None = None
        """How the rig was stopped on request; None: it was not"""
        self.state: Callable[[], Mapping[str, Any]] = dict
        """Returns the answer to the request ``state``. It is called in another thread, so it must
        not use the rig."""
        self._began_ns = command_began_ns() if began_ns is None else began_ns
        self._names = names_of(device)
        self._deciding = threading.Lock()
        self._armed = False
        mine = f"-{os.getpid()}-{next(_number)}" if private else ""
        self._locks = [Lock(runtime_folder() / f"{device_name(device)}{mine}.lock", device)]
        self._answering: _Answering | None = None
        try:
            self._answering = _Answering(self)
            self._answering.start()
            self._about = {
                "device": device,
                "pid": os.getpid(),
                "doing": doing or _command_line(),
                "since_utc": datetime.now(UTC).isoformat(timespec="seconds"),
                "private": private,
                "port": self._answering.port,
                "key": self._answering.key,
            }
            self._locks[0].write_holder(self._about)
        except BaseException:
            self.close()
            raise

    def claim(self, identity: Identity) -> None:
        """Lock the identified device on all of its ports. Raises DeviceError if it is in use.

        For a private (emulated) rig, the method does nothing, because no other process can reach
        this rig. Several emulated rigs have the same serial number, so a lock or an emergency stop
        by serial number would affect all of them.
        """
        if not self.private:
            self._names = names_of(self.device, [identity.serial])
            lock = Lock(device_lock_path(identity.serial, identity.boot), self.device)
            self._locks.append(lock)
            lock.write_holder(self._about)

    def request_estop(self, reason: str) -> None:
        """Request an emergency stop: set `stop_reason`, unless an earlier request has set it.

        The thread that uses the rig reads `stop_reason` and stops the rig. An emulated rig that was
        never armed needs no stop, so the method confirms the stop at once.
        """
        with self._deciding:
            self.stop_reason = self.stop_reason or reason
            if self.private and not self._armed and self.stopped is None:
                self.confirm("before it had armed its emulated rig")

    def begin_to_arm(self) -> str | None:
        """Return None if the rig may be armed now, else the reason of the stop that forbids it.

        Two kinds of emergency stop forbid arming:

        - A client requested the stop from this session.
        - The stop was stored after the time ``began_ns`` of the session (`Session`).

        A stop may also come during an attempt to arm. So call this method before and after each
        attempt, and stop the rig if the result is not None.
        """
        with self._deciding:
            if self.stop_reason is None:
                self.stop_reason = stopped_since(self._began_ns, self._names)
            self._armed = self._armed or self.stop_reason is None
            return self.stop_reason

    def confirm(self, how: str) -> None:
        """Answer all clients that requested a stop; ``how`` states how the rig was stopped."""
        self.stopped = how
        if self._answering is not None:
            self._answering.wake()

    def close(self) -> None:
        """Stop answering and release the locks. Idempotent."""
        if self._answering is not None:
            self._answering.close()
            self._answering = None
        while self._locks:
            self._locks.pop().release()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *problem: object) -> None:
        self.close()


class _Answering(threading.Thread):
    """The thread that answers a session's clients; a slow client does not delay the others."""

    def __init__(self, session: Session) -> None:
        super().__init__(name="heli3dof session", daemon=True)
        self._session = session
        self.key = os.urandom(16).hex()
        self._listener = socket.create_server(("127.0.0.1", 0), backlog=BACKLOG)
        self.port: int = self._listener.getsockname()[1]
        self._waker = socket.create_connection(("127.0.0.1", self.port))
        self._woken, _ = self._listener.accept()
        self._selector = selectors.DefaultSelector()
        for each in (self._listener, self._woken, self._waker):
            each.setblocking(False)
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._selector.register(self._woken, selectors.EVENT_READ)
        self._silent: dict[socket.socket, float] = {}
        """Clients without a request yet → when they connected (s, monotonic)"""
        self._waiting: list[socket.socket] = []
        """Clients that requested a stop and were not answered yet"""
        self._ending = False

    def wake(self) -> None:
        with contextlib.suppress(OSError):
            self._waker.send(b"!")

    def close(self) -> None:
        self._ending = True
        self.wake()
        if self.ident is not None:
            self.join(timeout=PATIENCE_S)

    def run(self) -> None:
        try:
            while not self._ending:
                for key, _ in self._selector.select(PATIENCE_S if self._silent else None):
                    self._serve(key.fileobj)
                self._answer_stops()
                self._drop_silent_clients()
        finally:
            self._answer_stops(over=True)
            self._selector.close()
            for each in (self._listener, self._woken, self._waker, *self._silent):
                each.close()

    def _serve(self, ready: Any) -> None:
        if ready is self._listener:
            self._accept()
        elif ready is self._woken:
            with contextlib.suppress(OSError):
                self._woken.recv(64)
        else:
            self._read_request(ready)

    def _accept(self) -> None:
        try:
            client, _ = self._listener.accept()
        except OSError:
            time.sleep(0.1)  # e.g. out of file descriptors: do not spin
            return
        if len(self._silent) >= MOST_CLIENTS:
            client.close()
            return
        client.setblocking(False)
        self._silent[client] = time.monotonic()
        self._selector.register(client, selectors.EVENT_READ)

    def _read_request(self, client: socket.socket) -> None:
        """Read a client's request and carry it out: stop the rig, or return its state.

        One receive call reads the request, which is far shorter than the buffer of a local socket.
        """
        self._forget(client)
        try:
            request = json.loads(client.recv(LONGEST_REQUEST))
            do = request["do"] if request["key"] == self.key else None
        except (OSError, ValueError, KeyError, TypeError):
            do = None
        if do is None:
            client.close()
        elif do == "estop":
            self._session.request_estop(str(request.get("reason", "no reason given")))
            self._waiting.append(client)
        elif do == "state":
            try:
                _answer(client, {"state": dict(self._session.state())})
            except Exception as problem:
                _answer(client, {"error": f"{type(problem).__name__}: {problem}"})
        else:
            _answer(client, {"error": f"this session cannot do {do!r}; it can estop and state"})

    def _answer_stops(self, *, over: bool = False) -> None:
        how = self._session.stopped
        if how is None and not over:
            return
        answer = {"over": "the session ended without a stop"} if how is None else {"stopped": how}
        while self._waiting:
            _answer(self._waiting.pop(), answer)

    def _drop_silent_clients(self) -> None:
        for client, since in list(self._silent.items()):
            if time.monotonic() - since > PATIENCE_S:
                self._forget(client)
                client.close()

    def _forget(self, client: socket.socket) -> None:
        self._silent.pop(client, None)
        self._selector.unregister(client)


def _answer(client: socket.socket, what: Mapping[str, Any]) -> None:
    with contextlib.suppress(OSError), client:
        client.sendall(json.dumps(what).encode() + b"\n")


def _command_line() -> str:
    name = Path(sys.argv[0]).name
    return " ".join(["heli3dof" if name == "__main__.py" else name, *sys.argv[1:]])[:200]
