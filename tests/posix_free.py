"""``python tests/posix_free.py MODULE WORD…``: run a module without POSIX-only functions.

It first removes the modules and attributes that Python on Windows lacks. The rest stays Linux (file
system, signals, ``sys.platform``). A run shows that the module needs nothing POSIX-only; it shows
nothing about Windows itself.
"""

from __future__ import annotations

import importlib.abc
import os
import runpy
import signal
import socket
import sys
import time
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

MODULES = ("fcntl", "termios", "resource", "pwd", "grp", "pty", "tty", "syslog", "_posixshmem")
ATTRIBUTES: dict[ModuleType, tuple[str, ...]] = {
    os: (
        "fork", "forkpty", "getuid", "geteuid", "getgid", "getegid", "openpty", "getloadavg",
        "wait", "waitid", "killpg", "setsid", "pread", "pwrite", "fdatasync", "posix_fadvise",
        "mkfifo", "O_NONBLOCK", "O_NOCTTY", "register_at_fork",
    ),
    socket: ("AF_UNIX", "socketpair"),
    signal: ("SIGHUP", "SIGKILL", "SIGSTOP", "SIGQUIT", "pthread_sigmask", "setitimer"),
    time: ("CLOCK_BOOTTIME", "clock_gettime", "clock_gettime_ns"),
}  # fmt: skip


class Missing(importlib.abc.MetaPathFinder):
    """Raises ModuleNotFoundError for each of `MODULES`."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name in MODULES:
            raise ModuleNotFoundError(f"{name} is POSIX-only", name=name)
        return None


def take_away() -> None:
    """Remove `MODULES` and `ATTRIBUTES` from this process."""
    for name in MODULES:
        sys.modules.pop(name, None)
    sys.meta_path.insert(0, Missing())
    for module, names in ATTRIBUTES.items():
        sched = [n for n in dir(module) if n.lower().startswith("sched_")]
        for name in (*names, *sched):
            if hasattr(module, name):
                delattr(module, name)


if __name__ == "__main__":
    take_away()
    sys.path[0] = os.getcwd()
    sys.argv = sys.argv[1:]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
