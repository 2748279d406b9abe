"""Pydantic models of the drivers' URL options; for ``quanser:`` see `quanser_hil.wiring`.

A field is one option: its type and bounds, its default and its description.

Import this module only where a rig is opened: pydantic takes 0.2 s of processor time to load, which
is too long for `heli3dof estop`.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self, get_args, get_origin

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainValidator, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from heli3dof.errors import UsageError, did_you_mean
from heli3dof.rig.url import DeviceUrl

from .link.serial_line import BAUD, PASSED_ON

Whole = Annotated[int, BeforeValidator(int)]
"""An integer written without a decimal point"""
EXPECTED = "expected"
"""Error type of the validators whose message states what the value must be"""


def expected(what: str) -> PydanticCustomError:
    """Return pydantic's error for an invalid value; ``what``: the valid values, in words."""
    return PydanticCustomError(EXPECTED, "{what}", {"what": what})


class UrlOptions(BaseModel):
    """Base class of the URL options. Each field with a description is an option of the URL.

    Options follow the ``?`` of the URL. A field without a description is read from the part before
    the ``?``.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return the names of the options that the URL may contain."""
        return tuple(row[0] for row in cls.rows())

    @classmethod
    def of(cls, url: DeviceUrl, **place: Any) -> Self:
        """Return the checked options of ``url``.

        ``place``: values of the fields that are read from the URL before its ``?``. If an
        option is repeated, its last value counts; a field of type ``tuple[str, ...]`` gets all.
        Raises UsageError for an unknown option, naming the nearest, and for a value out of bounds.
        """
        url.check_options(cls.names())
        given: dict[str, Any] = {}
        for name, field in cls.model_fields.items():
            texts = url.options.get(name, ())
            if field.annotation == tuple[str, ...]:
                given[name] = texts
            elif texts and (texts[-1] or field.annotation != float | None):
                given[name] = texts[-1]
        try:
            return cls(**place, **given)
        except ValidationError as error:
            raise cls._usage_error(url, error) from error

    @classmethod
    def _usage_error(cls, url: DeviceUrl, error: ValidationError) -> UsageError:
        first = error.errors()[0]
        name = str(first["loc"][0])
        field, text = cls.model_fields[name], url.one(name)
        what = first["msg"] if first["type"] == EXPECTED else _expectation(field)
        choices = _choices(field)
        return UsageError(
            f"{url.text}: {name}={text} is not {what}.",
            cause=f"a typing error; {did_you_mean(str(text), choices)}"
            if choices
            else "a typing error or another unit.",
            fix=f"{name}={_shown_default(field)}",
        )

    @classmethod
    def rows(cls) -> list[tuple[str, str, str]]:
        """Return (name, default, description) of each option."""
        return [
            (name, _shown_default(field), field.description)
            for name, field in cls.model_fields.items()
            if field.description
        ]


def _choices(field: FieldInfo) -> tuple[str, ...]:
    return get_args(field.annotation) if get_origin(field.annotation) is Literal else ()


def _bound(field: FieldInfo, name: str) -> float:
    return next(float(getattr(m, name)) for m in field.metadata if hasattr(m, name))


def _expectation(field: FieldInfo) -> str:
    if choices := _choices(field):
        return f"one of {', '.join(choices)}"
    kind = "a whole number" if field.annotation is int else "a number"
    return f"{kind} from {_bound(field, 'ge'):g} to {_bound(field, 'le'):g}"


def _shown_default(field: FieldInfo) -> str:
    if field.examples:
        return str(field.examples[0])
    return f"{field.default:g}" if isinstance(field.default, float) else str(field.default)


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

    @property
    def of_rig(self) -> dict[str, Any]:
        """Return the options of a `LinkRig`, as keyword arguments."""
        return {
            "stream": self.stream == "1", "watchdog_s": self.watchdog_s, "signs": self.signs
        }  # fmt: skip


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
    """URL options of ``usb+mock:``: the options of ``usb:`` and the options of an emulated rig.

    If both have an option of one name, the definition in `UsbOptions` applies.
    """

    bus: tuple[str, ...] = Field(
        default=(), description="faults of the bus: KIND@SECONDS[:FOR_SECONDS]"
    )
