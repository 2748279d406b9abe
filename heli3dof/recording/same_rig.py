"""`check_same_rig`: refuses recordings of different rigs, which one model cannot describe."""

from __future__ import annotations

from collections.abc import Sequence

from heli3dof.axes import AXES
from heli3dof.errors import UsageError
from heli3dof.recording.recording import Recording


def check_same_rig(recordings: Sequence[Recording]) -> None:
    """Raise UsageError if the recordings' profiles describe different rigs.

    Geometry, masses, inertias, thrust gain and encoder counts identify a rig. Controller, limits
    and rest angles may differ.
    """
    rigs = [_rig_numbers(r) for r in recordings]
    for r, rig in zip(recordings, rigs, strict=True):
        differing = [k for k, v in rig.items() if v != rigs[0][k]]
        if differing:
            key = differing[0]
            raise UsageError(
                f"{r.name} is of another rig than {recordings[0].name}: {key} = {rig[key]:g} and "
                f"{rigs[0][key]:g} in their profiles"
                + (f" (and {len(differing) - 1} more)." if differing[1:] else "."),
                cause="flights of two rigs were given, or the profile was corrected in between.",
                fix="give flights of one rig; if it is the same rig, load them with "
                "profile='FILE.toml'",
            )


def _rig_numbers(r: Recording) -> dict[str, float]:
    """Return key → value of a rig's geometry, masses, inertias, thrust gain and encoder counts."""
    p = r.profile
    parts = {"geometry": p.geometry, "mass": p.mass}
    numbers = {f"{k}.{n}": float(v) for k, part in parts.items() for n, v in part}
    numbers["motor.K_f"] = p.motor.K_f
    for axis in AXES:
        numbers[f"encoder.{axis}"] = float(getattr(p.encoder, axis))
        numbers[f"inertia.{axis}"] = getattr(p.inertia, axis, None) or 0.0  # 0: from the masses
    return numbers
