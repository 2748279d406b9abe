"""The default rig's profile with other limits, as an object and as a file for ``--profile``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from heli3dof.rig.profile import Profile, default_profile, profile_from_dict

STALL_S = 0.15
"""s: longest host stall that the tests tolerate (a virtual machine may lose all its processors)"""
START_S = 240.0
"""s: limit for the start of a flight in its own process. The first one compiles, which takes more
than a minute on two busy cores"""
END_S = 240.0
"""s: limit for the end of a process or the answer of a thread; a timeout, not a measured bound"""
PATIENT = {
    "late_max_s": 2 * STALL_S,
    "late_max_share": 1.0,
    "lost_max_s": 0.4,
    "slew_max_V_per_s": 1e6,
    "roll_rate_max_deg_per_s": 1e4,
    "pitch_rate_max_deg_per_s": 1e4,
    "yaw_rate_max_deg_per_s": 1e4,
    "roll_min_deg": -90.0,
}
"""Wide limits for real-time flights on busy machines, in tests of other properties.

They tolerate two host stalls in a row, during which the rig holds one voltage, may fall onto its
table and then move with a jerk. A test that is about one of these limits sets it itself.
"""


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
