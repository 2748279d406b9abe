"""A program that keeps cores from falling asleep: ``python -I -S spinner.py CORE…``

One process a core turns round for ever at idle priority (SCHED_IDLE): whatever else wants the core
has it at once. Each says in a line which core it turns on. All end when standard input does, and so
with whoever started them, however that ended; the keyboard's signals are for the flight. Only what
Python has built in is imported: this starts in some ms.
"""

import ctypes
import os
import signal
import sys

_PR_SET_PDEATHSIG = 1
KEYBOARD = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


def spin(core: int) -> None:
    """Never returns; ends with its parent, or where the core is not this program's."""
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
    os.close(1)  # what is left of it is the children's
    sys.stdin.read()
    for child in children:
        os.kill(child, signal.SIGKILL)


if __name__ == "__main__":
    main()
