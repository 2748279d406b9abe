"""`file_info`: describes a recording's file as a JSON-able dictionary.

`file_info` also reads the intact part of a torn file. A file is torn if its end is missing, for
example because the program was killed, or if bytes in the middle are unreadable.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.errors import RecordingError, quoted
from heli3dof.recording.amplifier_ratio import amplifier_warnings
from heli3dof.recording.link_quality import link_warnings
from heli3dof.recording.load import load
from heli3dof.recording.logs.importers import importer_of
from heli3dof.recording.logs.log_validation import timing
from heli3dof.recording.mcap_files.reader import broken, open_mcap, profile_in, recording_of
from heli3dof.recording.mcap_files.recover import loss_warnings, losses, salvage
from heli3dof.recording.motors_cut import motors_cut_warnings
from heli3dof.recording.recording import Recording
from heli3dof.recording.row import CLOSED_LOOP, RAMP_DOWN
from heli3dof.recording.safety_trip import outcome_details
from heli3dof.recording.still_encoder import still_encoder_warnings
from heli3dof.rig.clock import LATE_S
from heli3dof.rig.profile import Profile

PROVENANCE = (
    "source", "started_utc", "device", "identity", "log", "more_logs", "log_mapping", "versions",
    "git", "host", "command_line", "format",
)  # fmt: skip


def file_info(
    path: str | Path, profile: Profile | None = None, columns: str | Sequence[str] | None = None
) -> dict[str, Any]:
    """Return the `summary` of the recording in a file, and the file's name and size in bytes.

    If the key ``torn`` is True, the summary describes the intact part. Then ``damage`` is a
    sentence on the missing or unreadable bytes, and ``fix`` the command that copies the intact
    part. Raises RecordingError and UsageError, as `load` does.
    """
    return read_with_info(path, profile, columns)[1]


def read_with_info(
    path: str | Path, profile: Profile | None = None, columns: str | Sequence[str] | None = None
) -> tuple[Recording, dict[str, Any]]:
    """Return the recording in a file, and the `file_info` of this file.

    If the file is damaged, the recording is its intact part.
    """
    path = Path(path)
    salvaged = _salvaged(path, profile) if importer_of(path) is None else None
    about: dict[str, Any] = {
        "file": str(path),
        "bytes": path.stat().st_size if path.exists() else 0,
        "torn": salvaged is not None,
    }
    if salvaged is None:
        recording = load(path, profile, columns)
    else:
        recording, error = salvaged
        about |= {"damage": error.what, "fix": f"heli3dof recover {quoted(path)}"}
    return recording, {**about, **summary(recording)}


def _salvaged(path: Path, profile: Profile | None) -> tuple[Recording, RecordingError] | None:
    """Return the intact part of a damaged recording, and an error that describes the damage.

    The result is None if the file is not damaged, or if it contains no intact sample.
    """
    content = open_mcap(path)
    error = broken(path, content)
    if error is None:
        return None
    _, rows, chunks_damaged = salvage(path, content)
    if not len(rows):
        return None
    intact = recording_of(rows, content, profile or profile_in(content, path), path)
    details = {**outcome_details(intact), **losses(content, chunks_damaged)}
    return replace(intact, meta={**intact.meta, "outcome_details": details}), error


def summary(recording: Recording) -> dict[str, Any]:
    """Return a JSON-able dictionary that describes a recording.

    The dictionary has the recording's length, timing, ranges of angles (degrees) and voltages (V),
    plan, outcome, warnings and provenance.
    """
    meta: Mapping[str, Any] = recording.meta
    angles = {}
    for i, axis in enumerate(AXES):
        if axis in recording.axes:
            low, high = _range(np.rad2deg(recording.angle[:, i]))
            angles[axis] = {
                "min_deg": low,
                "max_deg": high,
                "reference": recording.has_reference(axis),
            }
    min_V, max_V = _range(recording.voltage)
    stuck = int((np.diff(recording.t) <= 0).sum())
    clock = (
        f"the time does not increase at {stuck} of {len(recording)} samples. Likely cause: the "
        "device's clock is stopped or runs backwards. Try: heli3dof doctor"
    )
    return {
        "name": recording.name,
        "samples": len(recording),
        "start_s": float(recording.t[0]) if len(recording) else None,
        "duration_s": float(np.ptp(recording.t)) if len(recording) else 0.0,
        "closed_loop_s": closed_loop_s(recording),
        "way_down": way_down(recording),
        "timing": asdict(timing(recording.t)) if len(recording) > 1 and not stuck else None,
        "lateness": lateness(recording),
        "angles": angles,
        "voltage": {
            "min_V": min_V,
            "max_V": max_V,
            "asked_for": recording.has_cmd,
            "extra": not bool(np.isnan(recording.voltage_extra).all()),
        },
        "channels": sorted(recording.channels),
        "profile": recording.profile.name,
        "rate_hz": recording.profile.loop.rate_hz,
        "loop_is_known": recording.profile.controller_is_known,
        "plan": meta.get("plan"),
        "seed": meta.get("seed"),
        "seeds": meta.get("seeds"),
        "outcome": meta.get("outcome"),
        "outcome_details": outcome_details(recording),
        "warnings": [
            *meta.get("warnings", []),
            *([clock] if stuck else []),
            *loss_warnings(recording.t, outcome_details(recording)),
            *flight_warnings(recording),
            *motors_cut_warnings(recording),
        ],
        "digest": recording.digest,
        "provenance": {key: meta[key] for key in PROVENANCE if key in meta},
    }


def flight_warnings(recording: Recording) -> list[str]:
    """Return warnings of a poor link, a wrong output voltage, and constant encoder counts."""
    return [
        *link_warnings(outcome_details(recording), len(recording), recording.profile.dt),
        *amplifier_warnings(recording),
        *still_encoder_warnings(recording),
    ]


def closed_loop_s(recording: Recording) -> float | None:
    """Return for how long in s a flight's loop was closed; None for an imported recording."""
    phase = recording.channels.get("phase")
    if phase is None:
        return None
    t = recording.t[phase == CLOSED_LOOP]
    return float(np.ptp(t)) + recording.profile.dt if len(t) else 0.0


def way_down(recording: Recording) -> str | None:
    """Return how a flight's voltages went to zero: ``ramp`` or ``at_once``; None: not recorded."""
    phase = recording.channels.get("phase")
    volts = recording.voltage[:0] if phase is None else recording.voltage[phase == RAMP_DOWN]
    if not len(volts):
        return None
    return "ramp" if volts[0].any() else "at_once"


def _range(values: np.ndarray) -> tuple[float | None, float | None]:
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (None, None)


def lateness(recording: Recording) -> dict[str, Any] | None:
    """Return statistics of the samples' lateness: the time in s from due time to arrival.

    The result is None if the lateness was not logged. It is also None for a virtual clock, with
    which no sample is late.
    """
    late = recording.channels.get("lateness_s")
    if late is None or not np.isfinite(late).any():
        return None
    if (recording.meta.get("identity") or {}).get("timebase") == "virtual":
        return None
    late = late[np.isfinite(late)]
    median, p99, p999 = np.quantile(late, (0.5, 0.99, 0.999))
    late_ticks = int((late > LATE_S).sum())
    return {
        "median_s": float(median),
        "p99_s": float(p99),
        "p999_s": float(p999),
        "max_s": float(late.max()),
        "late_ticks": late_ticks,
        "late_share": late_ticks / len(late),
    }
