"""Names of the counters of a rig's link to the host, and their names in older recordings.

``lost``                     samples that the device took and that never arrived
``device_skipped``           samples that the device never took because it was busy
``samples_stale``            samples that were outdated when the host read them
``commands_unacknowledged``  commands that the next sample did not echo
``malformed``                pieces received that were not a valid frame
``retries``                  requests sent again because no reply arrived
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

FORMER_NAMES = {
    "device_skipped": "left_out",
    "samples_stale": "passed_over",
    "commands_unacknowledged": "unheard",
    "malformed": "damaged",
    "retries": "repeats",
}
"""Present name → former name, which drivers may use for one more version"""
_PRESENT = {former: present for present, former in FORMER_NAMES.items()}


def present_names(details: Mapping[str, Any]) -> dict[str, Any]:
    """Return a flight's outcome details with former counter names replaced by the present ones.

    The counters in the entry ``link`` of the details are renamed, too.
    """
    renamed = {_PRESENT.get(name, name): value for name, value in details.items()}
    if isinstance(link := renamed.get("link"), Mapping):
        renamed["link"] = {_PRESENT.get(name, name): value for name, value in link.items()}
    return renamed


def attribute_of(statistics: Any, counter: str) -> str | None:
    """Return the name of this counter's attribute in ``statistics``; None without such a counter.

    ``statistics``: the link's counters of a rig. A driver that uses the counter's former name
    causes a DeprecationWarning.
    """
    if hasattr(statistics, counter):
        return counter
    former = FORMER_NAMES.get(counter)
    if former is None or not hasattr(statistics, former):
        return None
    warnings.warn(
        f"{type(statistics).__name__}.{former} is now called {counter}",
        DeprecationWarning,
        stacklevel=2,
    )
    return former


def count_of(statistics: Any, counter: str) -> int | None:
    """Return the value of the named link counter; None if ``statistics`` does not have it."""
    name = attribute_of(statistics, counter)
    value = getattr(statistics, name) if name else None
    return value if isinstance(value, int) else None
