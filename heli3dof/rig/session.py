"""A running session: it locks its rig, and a second terminal can stop it or look at it.

    locks    see `heli3dof.rig.locks`: the port's, and the device's once it is known
    socket   <runtime>/<device>.sock   one question a connection, one line of JSON each way:

        {"do": "estop", "reason": "…"}   answered when the rig has been stopped
        {"do": "state"}                  answered at once with what `Session.state` returns

A thread answers; it sleeps until somebody asks. The loop only looks at `Session.asked`, an
attribute, in every period (`heli3dof.rig.stoppable`), so that the rig is only ever spoken to by
one thread. An emulated rig is private to its process: nothing to lock, its files carry the pid.
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

from heli3dof.rig.locks import Lock, device_lock_path
from heli3dof.rig.places import POSSIBLE, device_name, runtime_folder
from heli3dof.rig.port import Identity

LONGEST_QUESTION = 4096
PATIENCE_S = 1.0
"""s that whoever connects may take to ask"""
SHORT_OF_S = 0.1
"""s until the next try where the system had no room for a connection"""
_number = itertools.count()


class Session:
    """One process's hold on one rig. Close it, or use it in a ``with`` statement.

    Raises DeviceError where another session holds the rig, saying which.
    """

    def __init__(self, device: str, *, private: bool = False, doing: str | None = None) -> None:
        self.device = device
        self.asked: str | None = None
        """Why somebody asked for an emergency stop; None: nobody did."""
        self.state: Callable[[], Mapping[str, Any]] = dict
        """What ``state`` answers; called by the answering thread, so it only looks."""
        self.private, self._doing = private, doing or _command_line()
        self._lock: Lock | None = None
        self._device_lock: Lock | None = None
        self._answering: _Answering | None = None
        self._stopped: str | None = None
        if not private:
            # Before the rig is opened: who asks for a stop now finds that it is never armed.
            self.serve()

    def serve(self) -> None:
        """Lock the rig and begin to answer; a private session does so only where told."""
        if self._answering is not None or not POSSIBLE:
            return
        mine = f"-{os.getpid()}-{next(_number)}" if self.private else ""
        path = runtime_folder() / f"{device_name(self.device)}{mine}.lock"
        self._lock = Lock(path, self.device, passing=self.private)
        self._about = {
            "device": self.device,
            "pid": os.getpid(),
            "doing": self._doing,
            "since_utc": datetime.now(UTC).isoformat(timespec="seconds"),
            "private": self.private,
        }
        try:
            self._lock.tell(self._about)
            self._answering = _Answering(self, path.with_suffix(".sock"))
            self._answering.start()
        except BaseException:
            self.close()
            raise

    def claim(self, identity: Identity) -> None:
        """Lock the device that answered, through whichever door. Raises DeviceError (busy)."""
        if self._lock is None or self.private:
            return
        path = device_lock_path(identity.serial, identity.boot)
        self._device_lock = Lock(path, self.device, passing=True)
        self._device_lock.tell(self._about)

    def ask_estop(self, reason: str) -> None:
        """Have the rig stopped by whoever talks to it; the first reason stands."""
        if self.asked is None:
            self.asked = reason

    def confirm(self, how: str) -> None:
        """The rig has been stopped: tell everybody who asked."""
        self._stopped = how
        if self._answering is not None:
            self._answering.wake()

    @property
    def stopped(self) -> str | None:
        """How the rig was stopped on request; None: it was not."""
        return self._stopped

    def close(self) -> None:
        """Let go of the rig. Idempotent."""
        if self._lock is None:
            return
        if self._answering is not None:
            self._answering.close()
        if self._device_lock is not None:
            self._device_lock.release()
        self._lock.release()
        self._lock = self._device_lock = None

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *problem: object) -> None:
        self.close()


class _Answering(threading.Thread):
    """Answers whoever connects; nobody who is slow or silent keeps another one waiting."""

    def __init__(self, session: Session, path: Path) -> None:
        super().__init__(name="heli3dof session", daemon=True)
        self._session, self._path = session, path
        self._ear = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        # The lock is ours, so a socket that is still there is a dead session's.
        path.unlink(missing_ok=True)
        self._ear.bind(str(path))
        self._ear.listen(16)
        self._woken, self._waker = socket.socketpair()
        for each in (self._ear, self._woken, self._waker):
            each.setblocking(False)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._ear, selectors.EVENT_READ)
        self._selector.register(self._woken, selectors.EVENT_READ)
        self._asking: dict[socket.socket, float] = {}
        """Connected, not asked yet → since when"""
        self._waiting: list[socket.socket] = []
        """Asked for a stop, not told yet"""
        self._ending = False

    def wake(self) -> None:
        with contextlib.suppress(OSError):
            self._waker.send(b"!")

    def close(self) -> None:
        self._ending = True
        self.wake()
        self.join(timeout=PATIENCE_S)
        # Here, while the lock is still ours: later it might be the next session's socket.
        self._path.unlink(missing_ok=True)

    def run(self) -> None:
        try:
            while not self._ending:
                for key, _ in self._selector.select(PATIENCE_S if self._asking else None):
                    self._attend(key.fileobj)
                self._tell_who_waits()
                self._lose_patience()
        finally:
            self._tell_who_waits(over=True)
            self._selector.close()
            for each in (self._ear, self._woken, self._waker, *self._asking):
                each.close()

    def _attend(self, ready: Any) -> None:
        if ready is self._ear:
            try:
                caller, _ = self._ear.accept()
            except OSError:
                # Out of file descriptors, say: no reason to spin beside the loop.
                time.sleep(SHORT_OF_S)
                return
            caller.setblocking(False)
            self._asking[caller] = time.monotonic()
            self._selector.register(caller, selectors.EVENT_READ)
        elif ready is self._woken:
            with contextlib.suppress(OSError):
                self._woken.recv(64)
        else:
            self._hear(ready)

    def _hear(self, caller: socket.socket) -> None:
        """One question, in one piece: it is far shorter than what a local socket delivers so."""
        self._let_go(caller)
        try:
            question = json.loads(caller.recv(LONGEST_QUESTION))
            do = question["do"]
        except (OSError, ValueError, KeyError, TypeError):
            caller.close()
            return
        if do == "estop":
            self._session.ask_estop(str(question.get("reason", "no reason given")))
            self._waiting.append(caller)
        elif do == "state":
            try:
                _answer(caller, {"state": dict(self._session.state())})
            except Exception as problem:
                _answer(caller, {"error": f"{type(problem).__name__}: {problem}"})
        else:
            _answer(caller, {"error": f"this session cannot do {do!r}; it can estop and state"})

    def _tell_who_waits(self, *, over: bool = False) -> None:
        how = self._session.stopped
        if how is None and not over:
            return
        for caller in self._waiting:
            if how is not None:
                _answer(caller, {"stopped": how})
            else:
                _answer(caller, {"over": "the session ended by itself at this moment"})
        self._waiting.clear()

    def _lose_patience(self) -> None:
        for caller, since in list(self._asking.items()):
            if time.monotonic() - since > PATIENCE_S:
                self._let_go(caller)
                caller.close()

    def _let_go(self, caller: socket.socket) -> None:
        self._asking.pop(caller, None)
        self._selector.unregister(caller)


def _answer(caller: socket.socket, what: Mapping[str, Any]) -> None:
    with contextlib.suppress(OSError), caller:
        caller.sendall(json.dumps(what).encode() + b"\n")


def _command_line() -> str:
    name = Path(sys.argv[0]).name
    return " ".join(["heli3dof" if name == "__main__.py" else name, *sys.argv[1:]])[:200]
