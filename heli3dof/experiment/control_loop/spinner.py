"""Keeps processor cores busy at idle priority: ``python -I -S spinner.py CORE…``

One process per core loops at idle priority (SCHED_IDLE), so that any other program gets the core at
once. Each writes its core's number in a line on standard output. All end when standard input
closes, and so with the program that started them. They ignore Ctrl-C and other end signals, which
the flight handles. Only built-in modules are imported, so that this starts within some ms.
"""

import ctypes
import os
import signal
import sys

_PR_SET_PDEATHSIG = 1
KEYBOARD = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


def spin(core: int) -> None:
    """Keep this core busy until the parent ends. Raises OSError if the system does not allow it."""
    parent = os.getppid()
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    os.sched_setaffinity(0, {core})
    os.write(1, b"%d\n" % core)
    os.close(1)
    while os.getppid() == parent:
        for _ in range(10**6):
            pass


def main() -> None:
    for which in KEYBOARD:
        signal.signal(which, signal.SIG_IGN)
    children = []
    for word in sys.argv[1:]:
        child = os.fork()
        if not child:
            try:
                spin(int(word))
            finally:
                os._exit(1)
        children.append(child)
    os.close(1)  # now only the children have it open
    sys.stdin.read()
    for child in children:
        os.kill(child, signal.SIGKILL)


if __name__ == "__main__":
    main()
