"""The exceptions of heli3dof, and the exit code of the process that each exception causes.

::

    Heli3dofError              1    a fault in heli3dof
    ├── UsageError             2    a wrong option, plan or value
    │   ├── ProfileError       2    a profile with an unknown or missing key or a wrong value
    │   ├── PlanError          2    an experiment plan that is invalid or leaves the envelope
    │   └── OutputExists       2    the output file exists and --force was not given
    ├── DeviceError            3    device missing, busy or not permitted
    ├── SafetyTrip             4    the safety envelope or an estop ended the flight
    ├── RecordingError         5    a recording or model file cannot be used
    │   └── NoSpace            5    the disk is full
    └── CheckFailed            6    a check failed
        └── UnstableLoop       6    the gain does not stabilise the chosen model

The command line prints what happened and, where known, the likely cause and the fix.
"""

from __future__ import annotations

import difflib
import re
import shlex
from collections.abc import Iterable


class Heli3dofError(Exception):
    """Base class of heli3dof errors: ``what`` happened, the likely ``cause``, the ``fix`` to try.

    ``exit_code`` is the process's exit code when the error reaches the command line.
    """

    exit_code = 1

    def __init__(self, what: str, *, cause: str = "", fix: str = "") -> None:
        super().__init__(what)
        self.what = what
        self.cause = cause
        self.fix = fix

    def __str__(self) -> str:
        parts = [self.what]
        if self.cause:
            parts.append(f"Likely cause: {self.cause}")
        if self.fix:
            parts.append(f"Try: {self.fix}")
        return "\n".join(parts)


class UsageError(Heli3dofError):
    exit_code = 2


class ProfileError(UsageError):
    pass


class PlanError(UsageError):
    pass


class OutputExists(UsageError):
    pass


class DeviceError(Heli3dofError):
    exit_code = 3


class SafetyTrip(Heli3dofError):
    exit_code = 4


class RecordingError(Heli3dofError):
    exit_code = 5


class NoSpace(RecordingError):
    pass


class CheckFailed(Heli3dofError):
    exit_code = 6


class UnstableLoop(CheckFailed):
    pass


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the word of ``known`` that is most similar to ``word``; None if none is similar.

    Upper and lower case count as equal.

    >>> nearest("motr", ["mass", "motor", "loop"]), nearest("L_A", ["L_w", "L_a"])
    ('motor', 'L_a')
    """
    words = {each.casefold(): each for each in known}
    match = difflib.get_close_matches(word.casefold(), words, n=1, cutoff=0.5)
    return words[match[0]] if match else None


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return a hint for a message: the name in ``known`` nearest to ``word``, else all names."""
    known = list(known)
    match = nearest(word, known)
    if match is not None:
        return f"did you mean {match!r}?"
    return "known: " + ", ".join(sorted(known))


def listed(names: Iterable[str], most: int) -> str:
    """Return the first ``most`` names for a message, and how many further ones there are.

    >>> listed(["t", "Vs", "Vd"], 2), listed(["t"], 2)
    ('t, Vs and 1 more', 't')
    """
    every = list(names)
    further = f" and {len(every) - most} more" if len(every) > most else ""
    return ", ".join(every[:most]) + further


def quoted(word: object) -> str:
    """Return a path or name as one word of a shell command in a message, in quotes if need be.

    >>> quoted("rig 1.mcap"), quoted("rig-1.mcap")
    ("'rig 1.mcap'", 'rig-1.mcap')
    """
    return shlex.quote(str(word))


def minus(text: str) -> str:
    """Return ``text`` with a true minus sign (−) before each negative number.

    Use it for text that people read. A command needs the hyphen-minus (-).

    >>> minus("roll -27.5° to +3.1°, front  -.5 V, step-10.mcap, 1e-05")
    'roll −27.5° to +3.1°, front  −.5 V, step-10.mcap, 1e−05'
    """
    return re.sub(r"(?<![\w./-])-(?=[\d.])|(?<=\de)-(?=\d)", "−", text)
