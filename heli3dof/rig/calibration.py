"""Where a rig's encoders stand when it rests, stored under its serial number by ``heli3dof zero``.

    angle = rest + (count − counts_at_rest) · 2π / counts per revolution

Counts begin at zero when the device starts (protocol.md), so counts_at_rest holds for one
start of the device. Two things tell a restart: another boot number, and another start instant
s = (host's time) − (device's uptime). A board without a random source or flash repeats its boot
number, so both are compared. With W the time since ``zero``, the start is the same where

    |s_now − s_zero| ≤ START_TOLERANCE_S + CLOCK_TOLERANCE · W        modulo UPTIME_WRAP_S

since after a restart s_now is later than the instant of ``zero``, and s_zero earlier.

=====================  ============================  ==========================================
stored                 the device states             counts_at_rest
=====================  ============================  ==========================================
nothing                                              0: the device is assumed to have started
                                                     at rest
boot, start            the same boot, the same start as stored
boot, start            another boot, or start        0, with a note that names heli3dof zero
boot                   the same boot, no start       as stored
no boot, start         the same start                as stored
no boot, no start      neither                       as stored, with a note of the date
for other encoders     other counts per rev.         0, with a note
=====================  ============================  ==========================================
"""

from __future__ import annotations

import os
import re
import time
import tomllib
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from heli3dof.rig.interface import Identity
from heli3dof.rig.session.paths import state_folder
from heli3dof.write_errors import explained

Counts = tuple[int, int, int]
UPTIME_WRAP_S = 2**32 / 1000
"""s: a device states its uptime in ms modulo 2³², 49.7 days (docs/reference/protocol.md, REPORT)"""
START_TOLERANCE_S = 2.0
"""s: a HELLO and a STATUS on a slow line, and an NTP step of the host's clock"""
CLOCK_TOLERANCE = 5e-3
"""s per s: a ceramic resonator, the worst clock of a microcontroller board, is within 0.5 %"""


@dataclass(frozen=True, slots=True)
class Calibration:
    """What ``zero`` measured."""

    serial: str
    boot: int | None
    counts_per_rev: Counts
    counts_at_rest: Counts
    zeroed_utc: str
    device: str
    """The URL it was measured through"""
    started_s: float | None = None
    """When the device had started, see `heli3dof.rig.interface.Identity`"""


@dataclass(frozen=True, slots=True)
class Rest:
    """What a session goes by: the counts at the rest angles, and what that rests on."""

    counts_at_rest: Counts
    known_from: str
    """``zero``: measured; ``power-up``: the device is taken to have started at rest"""
    note: str = ""
    """What the user should know; empty where there is nothing to be said"""

    def to_dict(self) -> dict[str, Any]:
        """As a recording's provenance keeps it."""
        about: dict[str, Any] = {
            "counts_at_rest": list(self.counts_at_rest),
            "known_from": self.known_from,
        }
        return about | ({"note": self.note} if self.note else {})


POWER_UP = Rest((0, 0, 0), "power-up")


def rest_of(identity: Identity) -> Rest:
    """What to go by for the rig that answered so."""
    try:
        stored = load_calibration(identity.serial)
    except ValueError as problem:
        note = f"the stored rest angles cannot be read ({problem}): run heli3dof zero again"
        return replace(POWER_UP, note=note)
    if stored is None:
        return POWER_UP
    if stored.counts_per_rev != identity.counts_per_rev:
        note = (
            f"the rest angles stored on {stored.zeroed_utc} are for encoders of "
            f"{stored.counts_per_rev} counts and are not used: run heli3dof zero again"
        )
        return replace(POWER_UP, note=note)
    same_start = _same_start(stored, identity)
    if stored.boot != identity.boot or same_start is False:
        repeated = f" (it repeats its boot number {identity.boot}, but its uptime shows it)"
        note = (
            f"the device has restarted since heli3dof zero on {stored.zeroed_utc}"
            f"{repeated if identity.boot is not None and stored.boot == identity.boot else ''}: "
            "the stored rest angles are not used, and the rig is assumed to have rested when the "
            "device started; if it did not, run heli3dof zero again"
        )
        return replace(POWER_UP, note=note)
    note = ""
    if identity.boot is None and same_start is None:
        note = (
            f"rest angles as of heli3dof zero on {stored.zeroed_utc}; this device does not state "
            "whether it was switched off since: if it was, run heli3dof zero again"
        )
    return Rest(stored.counts_at_rest, "zero", note)


def _same_start(stored: Calibration, identity: Identity) -> bool | None:
    """Whether the device has run since it was zeroed, by its uptime; None: it cannot be known."""
    if stored.started_s is None or identity.started_s is None:
        return None
    try:
        since_s = abs(time.time() - datetime.fromisoformat(stored.zeroed_utc).timestamp())
    except ValueError:
        return None
    half = UPTIME_WRAP_S / 2
    apart_s = (identity.started_s - stored.started_s + half) % UPTIME_WRAP_S - half
    return abs(apart_s) <= START_TOLERANCE_S + CLOCK_TOLERANCE * since_s


def calibration_path(serial: str) -> Path:
    """The file of one rig."""
    return state_folder() / "rigs" / (re.sub(r"[^A-Za-z0-9._-]", "_", serial) + ".toml")


def load_calibration(serial: str) -> Calibration | None:
    """What was stored for a rig; None: nothing. Raises ValueError for a file that is damaged."""
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
    boot = data.get("boot")
    started = data.get("started_s")
    serial_, zeroed, device = (data.get(key) for key in ("serial", "zeroed_utc", "device"))
    per_rev, at_rest = (_counts(data.get(key)) for key in ("counts_per_rev", "counts_at_rest"))
    texts = isinstance(serial_, str) and isinstance(zeroed, str) and isinstance(device, str)
    if not texts or per_rev is None or at_rest is None or not isinstance(boot, int | None):
        raise ValueError(f"{path}: a key is missing or of another kind")
    if not isinstance(started, int | float | None) or isinstance(started, bool):
        raise ValueError(f"{path}: started_s is no time")
    if serial_ != serial:
        raise ValueError(f"{path}: is for the rig {serial_}")
    return Calibration(serial, boot, per_rev, at_rest, str(zeroed), str(device), started)


def store_calibration(calibration: Calibration) -> Path:
    """Write it, whole or not at all; returns the file. Raises UsageError or NoSpace."""
    own = "set XDG_STATE_HOME to a folder of your own"
    with explained(Path("~/.local/state"), fix=own):
        path = calibration_path(calibration.serial)
    c = calibration
    lines = [
        "# Where this rig's encoders stand at its rest angles. Made by heli3dof zero.",
        f"serial = {_text(c.serial)}",
        *([] if c.boot is None else [f"boot = {c.boot}"]),
        *([] if c.started_s is None else [f"started_s = {c.started_s:.3f}"]),
        f"counts_per_rev = {list(c.counts_per_rev)}",
        f"counts_at_rest = {list(c.counts_at_rest)}",
        f"zeroed_utc = {_text(c.zeroed_utc)}",
        f"device = {_text(c.device)}",
    ]
    new = path.with_suffix(f".{os.getpid()}.new")
    with explained(path, fix=own):
        path.parent.mkdir(parents=True, exist_ok=True)
        new.write_text("\n".join(lines) + "\n", encoding="utf-8")
        new.replace(path)
    return path


def now_utc() -> str:
    """The time of a calibration."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def _counts(value: object) -> Counts | None:
    if isinstance(value, list) and len(value) == 3 and all(type(v) is int for v in value):
        return (value[0], value[1], value[2])
    return None


def _text(value: str) -> str:
    """A TOML basic string: JSON's escapes are a part of TOML's."""
    import json

    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
