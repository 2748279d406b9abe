"""A running session: it locks its rig, and a second terminal can stop it or look at it.

    locks    see `heli3dof.rig.session.locks`: the port's, and the device's once it is known
    socket   127.0.0.1, a port and a key that stand in the lock's holder file; one question a
             connection, one line of JSON each way:

        {"key": "…", "do": "estop", "reason": "…"}   answered when the rig has been stopped
        {"key": "…", "do": "state"}                  answered with what `Session.state` returns

A thread answers; it sleeps until a question comes. The loop only looks at `Session.asked`, an
attribute, in every period (`heli3dof.rig.session.stoppable_rig`), so that one thread alone speaks
to the rig. An emulated rig is private to its process: nothing to lock, its files carry the pid.
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

LONGEST_QUESTION = 4096
PATIENCE_S = 1.0
"""s that a caller may take to ask"""
BACKLOG = 128
"""Connections that the system takes while this process hangs: 12 s of a monitor's"""
MOST_CALLERS = 64
"""Connections that have not asked yet; another user of the computer can open them, too"""
_number = itertools.count()


class Session:
    """One process's hold on one rig. Close it, or use it in a ``with`` statement.

    ``began_ns``: when the command that wants the rig was given (`heli3dof.rig.session.stop_stamp`).
    Raises DeviceError where another session holds the rig, saying which.
    """

    def __init__(
        self, device: str, *, private: bool = False, doing: str | None = None,
        began_ns: int | None = None,
    ) -> None:  # fmt: skip
        self.device, self.private = device, private
        self.asked: str | None = None
        """Why an emergency stop was asked for; None: none was."""
        self.stopped: str | None = None
        """How the rig was stopped on request; None: it was not."""
        self.state: Callable[[], Mapping[str, Any]] = dict
        """What ``state`` answers; called by the answering thread, so it only looks."""
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
        """Lock the device that answered, through whichever door. Raises DeviceError (busy)."""
        self._names = names_of(self.device, [identity.serial])
        if not self.private:
            lock = Lock(device_lock_path(identity.serial, identity.boot), self.device)
            self._locks.append(lock)
            lock.write_holder(self._about)

    def ask_estop(self, reason: str) -> None:
        """Have the rig stopped by the thread that talks to it; the first reason stands."""
        with self._deciding:
            self.asked = self.asked or reason
            if self.private and not self._armed and self.stopped is None:
                self.confirm("before it had armed its emulated rig")

    def begin_to_arm(self) -> str | None:
        """Why the rig must not be armed: a stop asked for here, or one left for all. None: go on.

        To be asked again after every attempt: a stop may come while the rig is being armed.
        """
        with self._deciding:
            if self.asked is None:
                self.asked = stopped_since(self._began_ns, self._names)
            self._armed = self._armed or self.asked is None
            return self.asked

    def confirm(self, how: str) -> None:
        """The rig has been stopped: answer every caller who asked for it."""
        self.stopped = how
        if self._answering is not None:
            self._answering.wake()

    def close(self) -> None:
        """Let go of the rig. Idempotent."""
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
    """Answers its callers; one that is slow or silent keeps no other one waiting."""

    def __init__(self, session: Session) -> None:
        super().__init__(name="heli3dof session", daemon=True)
        self._session = session
        self.key = os.urandom(16).hex()
        self._ear = socket.create_server(("127.0.0.1", 0), backlog=BACKLOG)
        self.port: int = self._ear.getsockname()[1]
        self._waker = socket.create_connection(("127.0.0.1", self.port))
        self._woken, _ = self._ear.accept()
        self._selector = selectors.DefaultSelector()
        for each in (self._ear, self._woken, self._waker):
            each.setblocking(False)
        self._selector.register(self._ear, selectors.EVENT_READ)
        self._selector.register(self._woken, selectors.EVENT_READ)
        self._asking: dict[socket.socket, float] = {}
        """Connected, not asked yet → since when"""
        self._waiting: list[socket.socket] = []
        """Asked for a stop, not answered yet"""
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
                for key, _ in self._selector.select(PATIENCE_S if self._asking else None):
                    self._attend(key.fileobj)
                self._answer_stops()
                self._lose_patience()
        finally:
            self._answer_stops(over=True)
            self._selector.close()
            for each in (self._ear, self._woken, self._waker, *self._asking):
                each.close()

    def _attend(self, ready: Any) -> None:
        if ready is self._ear:
            self._accept()
        elif ready is self._woken:
            with contextlib.suppress(OSError):
                self._woken.recv(64)
        else:
            self._hear(ready)

    def _accept(self) -> None:
        try:
            caller, _ = self._ear.accept()
        except OSError:
            time.sleep(0.1)  # out of file descriptors, say: no reason to spin
            return
        if len(self._asking) >= MOST_CALLERS:
            caller.close()
            return
        caller.setblocking(False)
        self._asking[caller] = time.monotonic()
        self._selector.register(caller, selectors.EVENT_READ)

    def _hear(self, caller: socket.socket) -> None:
        """One question, in one piece: it is far shorter than what a local socket delivers so."""
        self._let_go(caller)
        try:
            question = json.loads(caller.recv(LONGEST_QUESTION))
            do = question["do"] if question["key"] == self.key else None
        except (OSError, ValueError, KeyError, TypeError):
            do = None
        if do is None:
            caller.close()
        elif do == "estop":
            self._session.ask_estop(str(question.get("reason", "no reason given")))
            self._waiting.append(caller)
        elif do == "state":
            try:
                _answer(caller, {"state": dict(self._session.state())})
            except Exception as problem:
                _answer(caller, {"error": f"{type(problem).__name__}: {problem}"})
        else:
            _answer(caller, {"error": f"this session cannot do {do!r}; it can estop and state"})

    def _answer_stops(self, *, over: bool = False) -> None:
        how = self._session.stopped
        if how is None and not over:
            return
        said = {"over": "the session ended by itself"} if how is None else {"stopped": how}
        while self._waiting:
            _answer(self._waiting.pop(), said)

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
