"""Pydantic models of the drivers' URL options; for ``quanser:`` see `quanser_hil.wiring`."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator

from .link.serial_line import BAUD, PASSED_ON
from .url_options import UrlOptions, Whole, expected

SPEEDS = {"real": 1.0, "max": math.inf}
SLOWEST, FASTEST = 0.01, 1e6
"""Bounds of the simulation's speed, as multiples of real time"""


def _speed(value: Any) -> float:
    if value in SPEEDS:
        return SPEEDS[value]
    try:
        speed = float(value)
    except ValueError:
        speed = math.nan
    if SLOWEST <= speed <= FASTEST:
        return speed
    raise expected(f"a number from {SLOWEST:g} to {FASTEST:g}, real or max")


class RigOptions(UrlOptions):
    """URL options that describe an emulated rig, valid for every driver of emulated rigs."""

    profile: str | None = Field(default=None, description="the rig's own profile, a TOML file")
    hide: tuple[str, ...] = Field(
        default=(), description="effects to hide: name[.axis]:value[@value]"
    )
    exercise: str | None = Field(
        default=None, description="an exercise's file, made by heli3dof exercise new"
    )
    seed: Whole = Field(default=0, ge=0, le=2**63, description="seed of all random numbers")
    noise: float = Field(default=1.0, ge=0, le=100, description="scale of the random torques")
    noise_s: float = Field(
        default=0.01, ge=1e-3, le=100, description="s, correlation time of the random torques"
    )
    vibration_hz: float = Field(
        default=0.0, ge=0, le=50, description="frequency of a vibrating mode; 0: none"
    )
    start: Literal["rest", "level"] = Field(
        default="rest", description="rest: on the table; level: held level until the first command"
    )
    spread: float = Field(
        default=0.0,
        ge=0,
        le=0.5,
        description="largest relative change of K_f, gravity torque and inertias",
    )
    rate_hz: float | None = Field(
        default=None, ge=10, le=10000, examples=[500], description="the device's own sample rate"
    )
    watchdog_s: float | None = Field(
        default=None,
        ge=1e-3,
        le=10,
        examples=[0.1],
        description="s without a command until the watchdog expires",
    )
    fault: tuple[str, ...] = Field(
        default=(), description="what fails, and when: KIND[.AXIS]@SECONDS[:COUNTS]"
    )


class MockOptions(RigOptions):
    speed: Annotated[float, PlainValidator(_speed)] = Field(
        default=1.0,
        examples=["real"],
        description="times real time; real; max: as fast as possible",
    )
    """Multiple of real time; inf: as fast as possible"""


class LinkOptions(UrlOptions):
    """URL options of every driver that uses the link protocol (docs/reference/protocol.md)."""

    stream: Literal["1", "0"] = Field(
        default="1", description="1: the device times its samples; 0: the host requests each one"
    )
    watchdog_s: float | None = Field(
        default=None,
        ge=1e-3,
        le=1,
        examples=[0.1],
        description="s without a command until the watchdog expires",
    )
    signs: Literal["device", "profile"] = Field(
        default="device", description="whose signs of the encoder counts apply"
    )


class SerialOptions(LinkOptions):
    baud: float = Field(default=BAUD, ge=1200, le=12_000_000, description="bits per second")
    low_latency: Literal["1", "0"] = Field(
        default="1", description="1: ask the port's driver to deliver bytes at once"
    )

    @classmethod
    def names(cls) -> tuple[str, ...]:
        return super().names() + PASSED_ON


class UsbOptions(LinkOptions):
    timeout_s: float = Field(
        default=0.25, ge=1e-3, le=10, description="s that the rig may take to accept a frame"
    )


class UsbMockOptions(UsbOptions, RigOptions):
    """URL options of ``usb+mock:``: those of ``usb:`` and of an emulated rig.

    An option that exists in both has the definition of `UsbOptions`.
    """

    bus: tuple[str, ...] = Field(
        default=(), description="faults of the bus: KIND@SECONDS[:FOR_SECONDS]"
    )
