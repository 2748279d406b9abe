"""`info`: what is in a file, as one JSON-able dictionary. Works on torn files too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.recording.link_quality import link_warnings
from heli3dof.recording.load import load
from heli3dof.recording.logs.import_log import is_log
from heli3dof.recording.logs.log_validation import timing
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile

LATE_S = 1e-3
"""A tick later than this is counted as late."""
PROVENANCE = (
    "source", "started_utc", "device", "identity", "log", "versions", "git", "host",
    "command_line", "format",
)  # fmt: skip


def file_info(
    path: str | Path, profile: Profile | None = None, columns: str | Sequence[str] | None = None
) -> dict[str, Any]:
    """`summary` of the recording in a file, with ``file``, ``bytes`` and ``torn``.

    A torn file of ours is summarised as far as it goes. Raises what `load` raises otherwise.
    """
    path = Path(path)
    torn = False
    if is_log(path):
        recording = load(path, profile, columns)
    else:
        from heli3dof.recording.mcap_files.reader import (
            decode,
            open_mcap,
            profile_in,
            read_recording,
        )
        from heli3dof.recording.mcap_files.recover import salvage

        found = open_mcap(path)
        torn = not found.whole
        if torn:
            rows = salvage(path, found).rows
            if len(rows):
                recording = decode(rows, found, profile or profile_in(found, path), path)
            else:
                recording = read_recording(path, profile)  # raises, saying that it is torn
        else:
            recording = read_recording(path, profile)
    about: dict[str, Any] = {"file": str(path), "bytes": path.stat().st_size, "torn": torn}
    if torn:
        about["fix"] = f"heli3dof recover {path}"
    return {**about, **summary(recording)}


def summary(recording: Recording) -> dict[str, Any]:
    """What a recording holds: length, timing, columns, ranges, loop, outcome, provenance."""
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
    return {
        "name": recording.name,
        "samples": len(recording),
        "duration_s": recording.duration if len(recording) else 0.0,
        "timing": timing(recording.t).to_dict() if len(recording) > 1 and not stuck else None,
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
        "loop_is_known": recording.profile.loop_is_known,
        "plan": meta.get("plan"),
        "seed": meta.get("seed"),
        "seeds": meta.get("seeds"),
        "outcome": meta.get("outcome"),
        "outcome_details": meta.get("outcome_details", {}),
        "warnings": [
            *meta.get("warnings", []),
            *_stuck_clock(stuck, len(recording)),
            *link_warnings(meta.get("outcome_details") or {}, recording.profile.dt),
        ],
        "digest": recording.digest,
        "provenance": {key: meta[key] for key in PROVENANCE if key in meta},
    }


def _stuck_clock(stuck: int, samples: int) -> list[str]:
    """What is wrong with times that do not rise."""
    if not stuck:
        return []
    return [
        f"the time does not rise at {stuck} of {samples} samples. Likely cause: the device's clock "
        "stands still or runs backwards. Try: heli3dof doctor, and what it says of the clock"
    ]


def _range(values: np.ndarray) -> tuple[float | None, float | None]:
    """Smallest and largest of the finite values; None where there is none."""
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (None, None)


def lateness(recording: Recording) -> dict[str, Any] | None:
    """How late the ticks were, where the loop logged it; None on a virtual clock too."""
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
