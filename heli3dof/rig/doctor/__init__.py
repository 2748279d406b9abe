"""The checks of ``heli3dof doctor``: functions that return a `Check`.

A file of this folder states in ``GROUP`` when its checks run, and lists them in ``CHECKS``. The
group determines the argument of these checks:

=============  =======================================  ===========================================
``GROUP``      called with                              examples
=============  =======================================  ===========================================
`COMPUTER`     the rig's `Profile`                      `host`: clock, load, memory, governors
`RECORDINGS`   the folder's `Path`                      `folder`: free space, time to synchronise
`RIG`          `link.Opened`: the open rig, readings    `link`: identity, round trip, loss, state
`ARMED`        `armed.Armed`: the rig at zero volts     `armed`: traffic, watchdog, emergency stop
=============  =======================================  ===========================================

To add a check, add a file with ``GROUP`` and ``CHECKS``, or a function to a file's ``CHECKS``.
Before the port is opened, the driver checks its permission and latency timer, and which process
uses it (`heli3dof.rig.interface.Driver.examine`).
`heli3dof.experiment.control_loop.realtime_priority` checks which real-time settings the operating
system permits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from heli3dof.errors import Heli3dofError, did_you_mean
from heli3dof.plugins import modules_of
from heli3dof.rig.interface import Check

COMPUTER, RECORDINGS, RIG, ARMED = GROUPS = ("computer", "recordings", "rig", "armed")


def checks_of(group: str) -> Iterator[Callable[[Any], Check]]:
    """Yield the check functions of every file in this folder whose ``GROUP`` is ``group``."""
    for module in modules_of(__name__):
        stated = getattr(module, "GROUP", None)
        if stated not in GROUPS or not hasattr(module, "CHECKS"):
            raise Heli3dofError(
                f"{module.__name__.replace('.', '/')}.py states no checks that can run: "
                f"its GROUP is {stated!r}.",
                cause="GROUP or CHECKS is missing, or GROUP is mistyped; "
                + did_you_mean(str(stated), GROUPS),
                fix="read heli3dof/rig/doctor/__init__.py",
            )
        if stated == group:
            yield from module.CHECKS


def verdict(what: str, found: str, good: bool, fix: str) -> Check:
    """Return a `Check` with these fields; its ``fix`` is empty if ``good``.

    ``what``: what was checked; ``found``: the result in words; ``good``: True if the check passed;
    ``fix``: what to do.
    """
    return Check(what, found, good, "" if good else fix)
