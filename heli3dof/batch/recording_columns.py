"""The first columns of the results table, which describe the recording.

They are the same for all subcommands of ``heli3dof batch``, and the condition of ``--where`` may
contain them. The columns ``roll_start_deg_std`` and ``pitch_start_deg_std`` contain the standard
deviation of an encoder's rounding error, 360°/(√12 · counts per revolution).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.recording.info import summary
from heli3dof.recording.recording import Recording
from heli3dof.rig.url import parse_url

COLUMNS: Mapping[str, str] = {
    "recording": "path or URL as given",
    "name": "the recording's name",
    "rig": "name in the profile",
    "serial": "serial number of the device; none for an emulated rig whose seed draws only noise",
    "started_utc": "start, ISO 8601 in UTC",
    "source": "flight, simulation or import",
    "plan": "name of the plan",
    "outcome": "how the flight ended",
    "duration_s": "first to last sample",
    "rate_hz": "nominal sample rate",
    "jitter_s": "standard deviation of the sample interval",
    "lost_share": "share of the samples that are missing",
    "late_share": "share of the samples that came late",
    "roll_start_deg": "roll at the first sample",
    "roll_start_deg_std": "its rounding error",
    "pitch_start_deg": "pitch at the first sample",
    "pitch_start_deg_std": "its rounding error",
    "digest": "SHA-256 of the samples",
}
RESOLUTION_S = 1e-9
"""s: resolution of the times in MCAP files. A smaller jitter is the rounding error of a float."""
STARTS = ("roll", "pitch")
"""Axes with a known start angle, that of the rig at rest on the table; yaw may start anywhere"""


def recording_columns(recording: Recording, path: str) -> dict[str, Any]:
    """Return column → value of a recording, for all `COLUMNS`; None if the value is unknown.

    ``path``: the recording's path or URL, as the user gave it.
    """
    about = summary(recording)
    made, timing = about["provenance"], about["timing"] or {}
    lateness, plan = about["lateness"] or {}, about["plan"]
    starts: dict[str, float | None] = {}
    for axis in STARTS:
        i = AXES.index(axis)
        start_deg = np.rad2deg(recording.angle[:1, i])
        count_deg = float(np.rad2deg(abs(recording.profile.encoder.rad_per_count[i])))
        known = np.isfinite(start_deg).any()
        starts[f"{axis}_start_deg"] = float(start_deg[0]) if known else None
        starts[f"{axis}_start_deg_std"] = count_deg / math.sqrt(12) if known else None
    return {
        "recording": path,
        "name": about["name"],
        "rig": about["profile"],
        "serial": _serial(made),
        "started_utc": made.get("started_utc"),
        "source": made.get("source"),
        "plan": plan.get("name") if isinstance(plan, Mapping) else plan,
        "outcome": about["outcome"],
        "duration_s": about["duration_s"],
        "rate_hz": about["rate_hz"],
        "jitter_s": _resolved(timing.get("jitter_s")),
        "lost_share": timing.get("lost_share"),
        "late_share": lateness.get("late_share"),
        **starts,
        "digest": about["digest"],
    }


def _resolved(time_s: float | None) -> float | None:
    """Return a time (s) rounded to a multiple of `RESOLUTION_S`.

    >>> _resolved(2.5e-15), _resolved(2.00004e-5)
    (0.0, 2e-05)
    """
    return None if time_s is None else round(time_s, round(-math.log10(RESOLUTION_S)))


def _serial(made: Mapping[str, Any]) -> str | None:
    """Return the serial number in a recording's provenance ``made``; None if it identifies no rig.

    The serial number of an emulated rig contains the seed of its random numbers. With the URL
    option ``spread`` or ``exercise``, different serial numbers mean different rig parameters.
    Otherwise only the noise differs, so the number identifies no rig.
    """
    identity, device = made.get("identity"), str(made.get("device", ""))
    is_emulated = device.startswith("mock:")
    noise_only = is_emulated and not {"spread", "exercise"} & parse_url(device).options.keys()
    return None if noise_only or not isinstance(identity, Mapping) else identity.get("serial")
