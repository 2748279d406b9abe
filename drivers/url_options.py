"""Base of the pydantic models of URL options, one class for each driver.

A field is one option: its type and bounds, its default and its description.

Import this module only where a rig is opened: pydantic takes 0.2 s of processor time to load, which
is too long for `heli3dof estop`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self, get_args, get_origin

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from heli3dof.errors import UsageError, did_you_mean
from heli3dof.rig.url import DeviceUrl

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
