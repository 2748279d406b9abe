"""The amplifier of docs/how-to/write-a-driver.md: an emulated rig that answers lines over TCP.

One thread, one selector: what came first is done first, so a master that hung up is gone before
the next one asks.
"""

from __future__ import annotations

import selectors
import socket
import threading
import time
from math import isfinite

from heli3dof_drivers.mock import device_of
from heli3dof_drivers.options import MockOptions

from heli3dof.rig.profile import Profile, default_profile

WATCHDOG_S = 0.3


class LabAmplifier:
    """Listens on a port of its own, in a thread, until it is closed."""

    def __init__(self, profile: Profile | None = None) -> None:
        self.profile = profile or default_profile()
        self._device = device_of(self.profile, MockOptions(watchdog_s=WATCHDOG_S))
        # The plant's first step may compile for seconds: not while the watchdog runs.
        device_of(self.profile, MockOptions(watchdog_s=WATCHDOG_S)).plant.step(0.0, 0.0)
        self._started = self._stepped = time.monotonic()
        self._master: socket.socket | None = None
        self._pending: dict[socket.socket, bytes] = {}
        self._selector = selectors.DefaultSelector()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._ending = False
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    @property
    def place(self) -> str:
        host, port = self._listener.getsockname()
        return f"{host}:{port}"

    def close(self) -> None:
        self._ending = True
        self._thread.join()
        self._listener.close()
        for line in self._pending:
            line.close()

    def hang_up(self) -> None:
        """The cable is pulled: every connection ends."""
        for line in list(self._pending):
            line.shutdown(socket.SHUT_RDWR)

    def _serve(self) -> None:
        while not self._ending:
            for key, _ in self._selector.select(0.02):
                line = key.fileobj
                assert isinstance(line, socket.socket)
                if line is self._listener:
                    self._accept()
                else:
                    self._receive(line)
            self._catch_up()

    def _accept(self) -> None:
        line, _ = self._listener.accept()
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._pending[line] = b""
        self._selector.register(line, selectors.EVENT_READ)

    def _receive(self, line: socket.socket) -> None:
        try:
            came = line.recv(4096)
        except OSError:
            came = b""
        if not came:
            self._drop(line)
            return
        *whole, self._pending[line] = (self._pending[line] + came).split(b"\n")
        for text in whole:
            self._catch_up()
            line.sendall(
                self._answer(line, text.decode().split()).encode(errors="surrogateescape") + b"\n"
            )

    def _drop(self, line: socket.socket) -> None:
        self._selector.unregister(line)
        del self._pending[line]
        line.close()
        if line is self._master:
            self._device.disable()
            self._master = None

    def _answer(self, line: socket.socket, words: list[str]) -> str:
        device = self._device
        if words == ["HOLD"]:
            if self._master not in (None, line):
                return "NO: another program is the master"
            self._master = line
            e = self.profile.encoder
            counts = f"{e.roll} {e.pitch} {e.yaw}"
            return f"lab-2000 bench-7 1.4 {counts} {device.v_max} {device.watchdog_s}"
        if words == ["STOP"]:
            device.stop()
        elif line is not self._master:
            return "NO: only the master may say that"
        elif words == ["ARM"]:
            device.arm()
        elif words[0] == "V":
            # A NaN becomes +v_max, as by max(-v_max, min(v_max, volts)).
            front, back = (v if isfinite(v) else device.v_max for v in map(float, words[2:]))
            device.command(int(words[1]), front, back)
        return self._sample()

    def _sample(self) -> str:
        device, t = self._device, time.monotonic() - self._started
        counts = " ".join(str(c) for c in device.plant.counts)
        front, back = device.v
        return f"{device.sequence} {t:.6f} {counts} {front!r} {back!r} {int(device.flags)}"

    def _catch_up(self) -> None:
        dt = self._device.plant.dt
        while self._stepped + dt <= time.monotonic():
            self._device.period()
            self._stepped += dt
