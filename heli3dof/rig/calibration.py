"""Stores and loads a rig's encoder counts at rest, as measured by ``heli3dof zero``.

    angle = rest + (count − counts_at_rest) · 2π / counts per revolution

Counts are zero when the device starts (docs/reference/protocol.md), so counts_at_rest is valid
until the next start. Two numbers detect a restart: the boot number, and the start instant s =
(host's time) − (device's uptime), both in s. A board without a random source or flash memory
repeats its boot number, so both numbers are compared. W is the time since ``heli3dof zero`` in s.
The device has not restarted if

    |s_now − s_zero| ≤ START_TOLERANCE_S + CLOCK_TOLERANCE · W        modulo UPTIME_WRAP_S

s_zero is the start instant stored by ``heli3dof zero``, s_now the present one. Only the boot number
shows a restart that stays within this tolerance. The first line that applies gives the counts:

=====================================================  ========================================
stored calibration, compared with the device           counts_at_rest
=====================================================  ========================================
none                                                   0: the device is assumed to have started
                                                       at rest
unreadable, or other counts per revolution             0, with a note
boot numbers differ, or only one of them is known      0, with a note
both start instants known, and too far apart           0, with a note
no boot number, and a start instant unknown            as stored, with a note of the date
any other                                              as stored
=====================================================  ========================================
"""

from __future__ import annotations

import json
import os
import re
import time
import tomllib
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from heli3dof.rig.clock import CLOCK_TOLERANCE, wrapped_difference_s
from heli3dof.rig.interface import Identity
from heli3dof.rig.session.paths import state_folder
from heli3dof.write_errors import write_errors_explained

Counts = tuple[int, int, int]
START_TOLERANCE_S = 2.0
"""s: covers the replies HELLO and STATUS on a slow line, and an NTP step of the host's clock"""


@dataclass(frozen=True, slots=True)
class Calibration:
    """Encoder counts of one device at its rest angles, as ``heli3dof zero`` measured them."""

    serial: str
    boot: int | None
    counts_per_rev: Counts
    counts_at_rest: Counts
    zeroed_utc: str
    device: str
    """The device's URL in that measurement"""
    started_s: float | None = None
    """When the device had started, s since 1970 by the host's clock; None: unknown"""


@dataclass(frozen=True, slots=True)
class RestCounts:
    """The encoder counts that a session assumes at the rest angles, and where they come from."""

    counts_at_rest: Counts
    known_from: str
    """``zero``: measured; ``power-up``: the device is assumed to have started at rest"""
    note: str = ""
    """What the user should know about the counts; empty if nothing"""

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as a dict for a recording's metadata; an empty note is left out."""
        about: dict[str, Any] = {
            "counts_at_rest": list(self.counts_at_rest),
            "known_from": self.known_from,
        }
        return about | ({"note": self.note} if self.note else {})


COUNTS_AT_POWER_UP = RestCounts((0, 0, 0), "power-up")


def rest_counts_of(identity: Identity) -> RestCounts:
    """Return the encoder counts at the rest angles of the connected device ``identity``.

    They are the stored counts or 0; the table at the top of this module lists the cases.
    """
    try:
        stored = load_calibration(identity.serial)
    except ValueError as problem:
        note = f"the stored rest angles cannot be read ({problem}): run heli3dof zero again"
        return replace(COUNTS_AT_POWER_UP, note=note)
    if stored is None:
        return COUNTS_AT_POWER_UP
    if stored.counts_per_rev != identity.counts_per_rev:
        note = (
            f"the rest angles stored on {stored.zeroed_utc} are for encoders of "
            f"{stored.counts_per_rev} counts and are not used: run heli3dof zero again"
        )
        return replace(COUNTS_AT_POWER_UP, note=note)
    same_start = _same_start(stored, identity)
    if stored.boot != identity.boot or same_start is False:
        repeated = identity.boot is not None and stored.boot == identity.boot
        evidence = (
            f" (its boot number {identity.boot} is the same, but its uptime shows the restart)"
        )
        note = (
            f"the device has restarted since heli3dof zero on {stored.zeroed_utc}"
            f"{evidence if repeated else ''}: the stored rest angles are not used. heli3dof "
            "assumes that the rig was at rest when the device started; if it was not, run "
            "heli3dof zero again"
        )
        return replace(COUNTS_AT_POWER_UP, note=note)
    note = ""
    if identity.boot is None and same_start is None:
        note = (
            f"rest angles of heli3dof zero on {stored.zeroed_utc}; this device does not report "
            "restarts: if it was switched off since, run heli3dof zero again"
        )
    return RestCounts(stored.counts_at_rest, "zero", note)


def _same_start(stored: Calibration, identity: Identity) -> bool | None:
    """Return True if the start instants of ``stored`` and of the device ``identity`` agree.

    They agree if they differ by at most the module's tolerance; if not, the device has restarted.
    Returns None if a start instant is missing, or if the date of ``stored`` is unreadable.
    """
    if stored.started_s is None or identity.started_s is None:
        return None
    try:
        since_s = abs(time.time() - datetime.fromisoformat(stored.zeroed_utc).timestamp())
    except ValueError:
        return None
    apart_s = wrapped_difference_s(identity.started_s, stored.started_s)
    return abs(apart_s) <= START_TOLERANCE_S + CLOCK_TOLERANCE * since_s


def calibration_path(serial: str) -> Path:
    return state_folder() / "rigs" / (re.sub(r"[^A-Za-z0-9._-]", "_", serial) + ".toml")


def load_calibration(serial: str) -> Calibration | None:
    """Return the stored calibration of the rig with this serial number; None if none is stored.

    Raises ValueError if the stored calibration is unreadable.
    """
    try:
        path = calibration_path(serial)
    except OSError as problem:
        raise ValueError(problem.strerror) from problem
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as problem:
        raise ValueError(f"{path}: {problem}") from problem
    try:
        # As JSON, since pydantic's strict mode takes no dict for a dataclass.
        text = json.dumps({"boot": None, **data}, default=str)
        stored = TypeAdapter(Calibration).validate_json(text, strict=True)
    except ValidationError:
        raise ValueError(f"{path}: a key is missing or has a wrong type") from None
    if stored.serial != serial:
        raise ValueError(f"{path} belongs to the rig {stored.serial}")
    return stored


def store_calibration(calibration: Calibration) -> Path:
    """Write the calibration to a file atomically; return its path. Raises UsageError or NoSpace."""
    own = "set XDG_STATE_HOME to a folder of your own"
    with write_errors_explained(Path("~/.local/state"), fix=own):
        path = calibration_path(calibration.serial)
    c = calibration
    lines = [
        "# Encoder counts of this rig at its rest angles. Written by heli3dof zero.",
        f"serial = {_text(c.serial)}",
        *([] if c.boot is None else [f"boot = {c.boot}"]),
        *([] if c.started_s is None else [f"started_s = {c.started_s:.3f}"]),
        f"counts_per_rev = {list(c.counts_per_rev)}",
        f"counts_at_rest = {list(c.counts_at_rest)}",
        f"zeroed_utc = {_text(c.zeroed_utc)}",
        f"device = {_text(c.device)}",
    ]
    new = path.with_suffix(f".{os.getpid()}.new")
    with write_errors_explained(path, fix=own):
        path.parent.mkdir(parents=True, exist_ok=True)
        new.write_text("\n".join(lines) + "\n", encoding="utf-8")
        new.replace(path)
    return path


def _text(value: str) -> str:
    """Return ``value`` as a quoted TOML string."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
