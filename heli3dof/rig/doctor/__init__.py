"""The checks of ``heli3dof doctor``: one function each, returning a `Check`.

- `host`: the computer's clock, wake-up latency, load, memory, frequency governors
- `folder`: where recordings go: free space and time to synchronise
- `link`: the open rig: identity, round trip, loss, clock, state, rest angles
- `armed`: an armed rig at zero volts, on request (``--arm``)

The driver checks its port before it is opened: permission, holder, latency timer
(`heli3dof.rig.interface.Driver.examine`). `heli3dof.experiment.control_loop.realtime_priority`
checks what the system grants the loop. To add a check, add a function to a file's ``CHECKS``.
"""

from __future__ import annotations

from heli3dof.rig.interface import Check


def verdict(what: str, found: str, good: bool, fix: str) -> Check:
    """Make a `Check` of these fields; ``fix`` is dropped if ``good``."""
    return Check(what, found, good, "" if good else fix)
