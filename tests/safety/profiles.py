"""The default rig's profile with other limits, as a file for ``--profile``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from heli3dof.rig.profile import Profile, default_profile, profile_from_dict

PATIENT = {
    "slew_max_V_per_s": 1e6,
    "roll_rate_max_deg_per_s": 1e4,
    "pitch_rate_max_deg_per_s": 1e4,
    "yaw_rate_max_deg_per_s": 1e4,
    "roll_min_deg": -90.0,
    "late_max_share": 1.0,
}
"""For machines that are busy: a host that was away for 0.1 s in the take-off moves on in a jerk"""


def profile(*, v_max: float | None = None, **limits: Any) -> Profile:
    """The default profile, with these limits and this amplifier."""
    given = default_profile().to_dict()
    given["limits"] |= limits
    if v_max is not None:
        given["motor"]["v_max"] = v_max
    return profile_from_dict(given)


def profile_file(folder: Path, **changed: Any) -> Path:
    """`profile` as a TOML file."""
    given = profile(**changed).to_dict()
    lines = [f'name = "{given["name"]}"']
    for section, values in given.items():
        if isinstance(values, dict):
            lines += [f"[{section}]", *(f"{key} = {value}" for key, value in values.items())]
    path = folder / "rig.toml"
    path.write_text("\n".join(lines))
    return path
