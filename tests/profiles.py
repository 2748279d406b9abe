"""The default rig's profile with other limits, as an object and as a file for ``--profile``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from heli3dof.rig.profile import Profile, default_profile, profile_from_dict

STANDSTILL_S = 0.15
"""s for which a machine that runs tests may stand still, all its processors at once: a virtual one
is not always given them."""
START_S = 240.0
"""s in which a flight in a process of its own begins: the first one compiles, on two cores that
others use for more than a minute"""
END_S = 240.0
"""s in which a process ends that was told to, or a thread comes to what it was given; nothing is
measured by it"""
PATIENT = {
    "late_max_s": 2 * STANDSTILL_S,
    "late_max_share": 1.0,
    "lost_max_s": 0.4,
    "slew_max_V_per_s": 1e6,
    "roll_rate_max_deg_per_s": 1e4,
    "pitch_rate_max_deg_per_s": 1e4,
    "yaw_rate_max_deg_per_s": 1e4,
    "roll_min_deg": -90.0,
}
"""Limits of every flight in real time that is not about them, for machines that have other work and
stand still: two standstills in a row are borne, and a rig that held one voltage through them may
fall onto its table and move on in a jerk. What a test is about it sets itself, after these."""


def profile(
    *, v_max: float | None = None, rate_hz: float | None = None, **limits: float
) -> Profile:
    """The default profile with these limits, this amplifier and this rate."""
    given: dict[str, Any] = default_profile().to_dict()
    given["limits"] |= limits
    if v_max is not None:
        given["motor"]["v_max"] = v_max
    if rate_hz is not None:
        given["loop"]["rate_hz"] = rate_hz
    return profile_from_dict(given)


def write_profile(path: Path, **changed: float) -> Path:
    """`profile` as a TOML file."""
    data = profile(**changed).to_dict()
    lines = [f"{k} = {json.dumps(v)}" for k, v in data.items() if not isinstance(v, dict)]
    for section, keys in data.items():
        if isinstance(keys, dict):
            lines += [f"[{section}]", *(f"{k} = {json.dumps(v)}" for k, v in keys.items())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
