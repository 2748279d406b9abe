"""Identifies the device at a connection and compares it with the rig's profile."""

from __future__ import annotations

from typing import TYPE_CHECKING

from heli3dof.axes import AXES
from heli3dof.errors import DeviceError

from .frames import VERSION, Ack, Hello, IdentityFrame, decoded
from .request_reply import REPLY_TIMEOUT_S, RequestClient

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile

TRIES = 12
"""HELLO requests: a board that restarts when its port is opened needs up to 2 s to reply"""
FLUSHES = 64
"""Largest number of reads that discard bytes which arrived before the first request"""


def identify(client: RequestClient) -> IdentityFrame:
    """Return the device's identity, its reply to a HELLO request.

    Raises DeviceError if no byte arrives, if the device is not a rig, or if it uses another
    protocol version.
    """
    transport = client.transport
    for _ in range(FLUSHES):
        if not transport.read(0.0):
            break
    transport.write(b"\0")

    reply = client.request(Hello, (IdentityFrame, Ack), tries=TRIES)
    if isinstance(reply, IdentityFrame):
        if reply.version != VERSION:
            raise _other_version(transport.name, reply.version)
        return reply
    if reply is not None:
        raise _other_version(transport.name, None)
    if not client.tail:
        raise DeviceError(
            f"{transport.name}: no reply.",
            cause=f"{TRIES} requests in {TRIES * REPLY_TIMEOUT_S:g} s brought no byte: the device "
            "is switched off, or this is another port.",
            fix="switch the amplifier on; heli3dof devices lists the ports",
        )
    version = foreign_version(client.tail)
    if version is not None:
        raise _other_version(transport.name, version)
    raise DeviceError(
        f"{transport.name}: the device that replies is not a rig ({_shown(client.tail)}).",
        cause="another baud rate than the device's, or another instrument on this port.",
        fix="set the rate that the device's manual gives, e.g. ?baud=115200; heli3dof devices",
    )


def foreign_version(received: bytes) -> int | None:
    """Return the version of the first valid frame in ``received`` whose version is not ours.

    Returns None if all valid frames have the protocol version that heli3dof uses.
    """
    for piece in received.split(b"\0"):
        data = decoded(piece)
        if data is not None and data[0] != VERSION:
            return data[0]
    return None


def _other_version(name: str, version: int | None) -> DeviceError:
    theirs = f"version {version}" if version is not None else "other versions only"
    return DeviceError(
        f"{name}: the device uses {theirs} of the link's protocol, heli3dof version {VERSION}.",
        cause="its firmware is older or newer than this heli3dof.",
        fix="pip install --upgrade heli3dof, or flash the firmware that came with this one",
    )


def _shown(received: bytes) -> str:
    text = received[:24].decode("ascii", "replace").strip()
    readable = all(c.isprintable() or c.isspace() for c in text) and "\ufffd" not in text
    shown = repr(text) if readable else received[:12].hex(" ")
    return f"{len(received)} bytes, {shown}"


def check_profile(
    identity: IdentityFrame, profile: Profile, name: str, *, signs: str = "device"
) -> None:
    """Raise a DeviceError if the device's ``identity`` contradicts the ``profile``.

    The cases are:

    - The profile's counts per revolution have another size or sign than the device's. With
      ``signs="profile"`` the signs may differ; the profile's apply.
    - The profile's voltage limit is above the device's.
    - The profile's control period is below the device's shortest sample period.

    The error names the profile's key. ``name`` is the rig's port or URL.
    """
    for axis, theirs in zip(
        AXES, (identity.counts_roll, identity.counts_pitch, identity.counts_yaw), strict=True
    ):
        ours = getattr(profile.encoder, axis)
        if abs(ours) != abs(theirs):
            raise DeviceError(
                f"{name}: the device counts {theirs} per revolution of {axis}, the profile "
                f"{profile.name!r} has encoder.{axis} = {ours}.",
                cause="the profile is another rig's, or its resolution is before the ×4.",
                fix=f"give the rig's own --profile, or set encoder.{axis} = {theirs} in it",
            )
        if ours != theirs and signs != "profile":
            raise DeviceError(
                f"{name}: the device states that its {axis} counts {_way(theirs)} as the angle "
                f"rises; the profile {profile.name!r} states that they {_way(ours)} "
                f"(encoder.{axis} = {ours}).",
                cause="one of them is wrong; with the wrong sign the loop drives the rig away from "
                "its reference.",
                fix=f"encoder.{axis} = {theirs} in the profile; or ?signs=profile, if turning the "
                "rig by hand (heli3dof monitor) shows that the profile is right",
            )
    v_max = identity.v_max_uV / 1e6
    if profile.motor.v_max > v_max * (1 + 1e-6):
        raise DeviceError(
            f"{name}: the amplifier puts out at most {v_max:g} V, the profile {profile.name!r} "
            f"has motor.v_max = {profile.motor.v_max:g}.",
            cause="the amplifier would clip higher commands.",
            fix=f"motor.v_max = {v_max:g} in the profile",
        )
    period_us = period_of(profile)
    if period_us < identity.shortest_us:
        raise DeviceError(
            f"{name}: the device's shortest sample period is {identity.shortest_us} µs, the "
            f"profile {profile.name!r} has loop.rate_hz = {profile.loop.rate_hz:g}.",
            cause="the profile was made for a faster link.",
            fix=f"loop.rate_hz = {1e6 / identity.shortest_us:g} or less in the profile",
        )


def period_of(profile: Profile) -> int:
    """Return the profile's control period (one over ``loop.rate_hz``), rounded to whole µs."""
    return round(1e6 / profile.loop.rate_hz)


def _way(counts: int) -> str:
    return "rise" if counts > 0 else "fall"
