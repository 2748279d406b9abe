"""Compare the rigs that profiles and serial numbers describe: one model cannot describe two rigs.

`check_same_rig` refuses recordings of different rigs. `differing_numbers` describes the difference
of two profiles as text.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from heli3dof.axes import AXES
from heli3dof.errors import UsageError
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile


def check_same_rig(recordings: Sequence[Recording]) -> None:
    """Raise UsageError if the recordings' profiles describe different rigs.

    Geometry, masses, inertias, thrust gain, encoder counts and the device's serial number identify
    a rig. Controller, limits and rest angles may differ.
    """
    serials = {serial: r.name for r in reversed(recordings) if (serial := _serial(r))}
    if len(serials) > 1:
        (other, its_name), *_, (first, name) = serials.items()
        raise UsageError(
            f"{its_name} is of another rig than {name}: serial numbers {other} and {first}.",
            cause="flights of two rigs were given, or its electronics were exchanged in between.",
            fix="give flights of one rig",
        )
    for r in recordings[1:]:
        if differing := differing_numbers(r.profile, recordings[0].profile):
            raise UsageError(
                f"{r.name} is of another rig than {recordings[0].name}: {differing}.",
                cause="flights of two rigs were given, or the profile was corrected in between.",
                fix="give flights of one rig; if it is the same rig, load them with "
                "profile='FILE.toml'",
            )


def differing_numbers(one: Profile | None, other: Profile) -> str:
    """Return, as text, one parameter that differs between two profiles, with both values.

    The text becomes part of a message. It also states how many more parameters differ. Only
    parameters that identify a rig are compared (`_rig_numbers`). The text is empty if all of them
    are equal, or if ``one`` is None (the model has no profile).
    """
    if one is None:
        return ""
    numbers, others = _rig_numbers(one), _rig_numbers(other)
    differing = [k for k, v in numbers.items() if v != others[k]]
    if not differing:
        return ""
    key, *further = differing
    more = f" (and {len(further)} more)" if further else ""
    return f"{key} = {numbers[key]:g} and {others[key]:g} in their profiles{more}"


def _serial(r: Recording) -> str | None:
    """Return the device's serial number; None if unknown, or that of an emulated rig (its seed)."""
    identity = r.meta.get("identity")
    serial = identity.get("serial") if isinstance(identity, Mapping) else None
    return None if str(serial).startswith("mock-") else serial


def _rig_numbers(p: Profile) -> dict[str, float]:
    """Return key → value of a rig's geometry, masses, inertias, thrust gain and encoder counts."""
    parts = {"geometry": p.geometry, "mass": p.mass}
    numbers = {f"{k}.{n}": float(v) for k, part in parts.items() for n, v in part}
    numbers["motor.K_f"] = p.motor.K_f
    for axis in AXES:
        numbers[f"encoder.{axis}"] = float(getattr(p.encoder, axis))
        numbers[f"inertia.{axis}"] = getattr(p.inertia, axis, None) or 0.0  # 0: from the masses
    return numbers
