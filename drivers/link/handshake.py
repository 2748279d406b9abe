"""The first words: who answers, in which version, and is it the rig of the profile?"""

from __future__ import annotations

from typing import TYPE_CHECKING

from cobs.cobs import DecodeError, decode

from heli3dof.errors import DeviceError

from .checksum import check
from .frames import VERSION, Ack, Frame, Hello, IdentityFrame, Type
from .request_reply import PATIENCE_S, Dialogue

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile

TRIES = 12
"""Boards that start anew when their port is opened need two seconds until they listen."""
AXES = ("roll", "pitch", "yaw")


def greet(dialogue: Dialogue) -> IdentityFrame:
    """Ask who is there. Raises DeviceError: nobody, something else, or another version."""
    transport = dialogue.transport
    transport.flush_input()
    transport.write(b"\0")

    def answer(frame: Frame, numbers: set[int]) -> IdentityFrame | Ack | None:
        if not isinstance(frame, IdentityFrame | Ack) or frame.number not in numbers:
            return None
        return None if isinstance(frame, Ack) and frame.request != Type.HELLO else frame

    said = dialogue.ask(Hello, answer, tries=TRIES)
    if isinstance(said, IdentityFrame):
        if said.version != VERSION:
            raise _other_version(transport.name, said.version)
        return said
    if said is not None:
        raise _other_version(transport.name, None)
    heard = dialogue.overheard
    if not heard:
        raise DeviceError(
            f"{transport.name}: nobody answers.",
            cause=f"{TRIES} questions in {TRIES * PATIENCE_S:g} s stayed without one byte: the "
            "device is switched off, or this is another port.",
            fix="switch the amplifier on; heli3dof devices lists the ports",
        )
    version = foreign_version(heard)
    if version is not None:
        raise _other_version(transport.name, version)
    raise DeviceError(
        f"{transport.name}: something answers, but not a rig ({_shown(heard)}).",
        cause="another baud rate than the device's, or another instrument on this port.",
        fix="name the rate that the device's manual gives, e.g. ?baud=115200; heli3dof devices",
    )


def foreign_version(heard: bytes) -> int | None:
    """The version of a whole frame of another protocol version among these bytes, if any."""
    for piece in heard.split(b"\0"):
        try:
            data = decode(piece)
        except DecodeError:
            continue
        if len(data) >= 10 and check(data[:-4]) == data[-4:] and data[0] != VERSION:
            return int(data[0])
    return None


def _other_version(name: str, version: int | None) -> DeviceError:
    theirs = f"version {version}" if version is not None else "other versions only"
    return DeviceError(
        f"{name}: the device speaks {theirs} of the link's protocol, heli3dof version {VERSION}.",
        cause="its firmware and this heli3dof are of different age.",
        fix="pip install --upgrade heli3dof, or flash the firmware that came with this one",
    )


def _shown(heard: bytes) -> str:
    text = heard[:24].decode("ascii", "replace").strip()
    readable = all(c.isprintable() or c.isspace() for c in text) and "\ufffd" not in text
    shown = repr(text) if readable else heard[:12].hex(" ")
    return f"{len(heard)} bytes, {shown}"


def check_profile(
    identity: IdentityFrame, profile: Profile, name: str, *, signs: str = "device"
) -> None:
    """Is this the profile's rig? Raises DeviceError naming the profile's key that differs.

    ``signs="profile"``: which way the encoders count is believed to the profile.
    """
    for axis, theirs in zip(
        AXES, (identity.counts_roll, identity.counts_pitch, identity.counts_yaw), strict=True
    ):
        ours = getattr(profile.encoder, axis)
        if abs(ours) != abs(theirs):
            raise DeviceError(
                f"{name}: the device counts {theirs} per revolution of {axis}, the profile "
                f"{profile.name!r} says encoder.{axis} = {ours}.",
                cause="the profile is another rig's, or its resolution was meant before ×4.",
                fix=f"--profile the rig's own, or encoder.{axis} = {theirs} in it",
            )
        if ours != theirs and signs != "profile":
            raise DeviceError(
                f"{name}: the device says its {axis} counts {_way(theirs)} as the angle rises, "
                f"the profile {profile.name!r} (encoder.{axis} = {ours}) that they {_way(ours)}.",
                cause="one of them is wrong, and with the wrong sign the loop drives the rig away "
                "from its reference.",
                fix=f"encoder.{axis} = {theirs} in the profile; or, where turning the rig by hand "
                "(heli3dof monitor) shows that the profile is right, ?signs=profile",
            )
    v_max = identity.v_max_uV / 1e6
    if profile.motor.v_max > v_max * (1 + 1e-6):
        raise DeviceError(
            f"{name}: the amplifier puts out at most {v_max:g} V, the profile {profile.name!r} "
            f"says motor.v_max = {profile.motor.v_max:g}.",
            cause="what the controller asks for above that would be cut off unseen.",
            fix=f"motor.v_max = {v_max:g} in the profile",
        )
    period_us = period_of(profile)
    if period_us < identity.shortest_us:
        raise DeviceError(
            f"{name}: the device samples every {identity.shortest_us} µs at the fastest, the "
            f"profile {profile.name!r} says loop.rate_hz = {profile.loop.rate_hz:g}.",
            cause="the profile was made for a faster link.",
            fix=f"loop.rate_hz = {1e6 / identity.shortest_us:g} or less in the profile",
        )


def period_of(profile: Profile) -> int:
    """µs, whole: the control period."""
    return round(1e6 / profile.loop.rate_hz)


def _way(counts: int) -> str:
    return "rise" if counts > 0 else "fall"
