"""Read hand-written TOML files (profiles, plans) and check them against a pydantic model.

An unknown or missing key or a wrong value is an error that names the key and the file. For an
unknown key the error also names the nearest known key. All errors of a file are reported at once.
`Key` describes a field: meaning, unit, ranges, how to measure it. This description appears in error
messages, prompts, comments in written files and tables of the documentation.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError, core_schema

from heli3dof.errors import UsageError, did_you_mean, nearest, quoted
from heli3dof.file_kind import no_file, toml_kind, toml_use

Positive = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]

RECORDED = "recorded"
"""Key in pydantic's validation context: the data is from a recording; do not check its ranges."""

Range = tuple[float, float]

MISTAKEN_UNITS: Mapping[str, tuple[tuple[str, float], ...]] = {
    "m": (("centimetres", 0.01), ("millimetres", 0.001), ("inches", 0.0254)),
    "kg": (("grams", 0.001), ("pounds", 0.4536)),
    "kg·m²": (("kg·cm²", 1e-4), ("g·m²", 1e-3)),
    "N/V": (("gram-force per volt", 0.00981), ("mN/V", 0.001)),
    "V": (("millivolts", 0.001),),
    "Hz": (("kilohertz", 1000.0),),
    "°": (("radians", 57.29578),),
    "s": (("milliseconds", 0.001),),
}
"""Unit → the units that people use by mistake instead: (name, size in the right unit)"""


@dataclass(frozen=True)
class Key:
    """The description of a TOML key: its meaning, its unit, how to measure it, and limits."""

    meaning: str
    unit: str = "–"
    measure: str = ""
    """How to measure or choose it"""
    typical: str = ""
    """Its value on a common rig, for a prompt"""
    usual: Range | None = None
    """Outside this range the number is legal but unusual."""
    plausible: Range | None = None
    """Outside this range the number is an error."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.with_info_after_validator_function(self._checked, handler(source))

    def _checked(self, value: Any, info: core_schema.ValidationInfo) -> Any:
        if (
            not is_recorded(info)
            and self.plausible is not None
            and not within(value, self.plausible)
        ):
            low, high = self.plausible
            raise PydanticCustomError(
                "implausible",
                "not plausible; the range is {low} to {high} {unit}",
                {
                    "low": f"{low:g}",
                    "high": f"{high:g}",
                    "unit": self.unit,
                    "slip": self.wrong_unit(value),
                },
            )
        return value

    def wrong_unit(self, value: float) -> str:
        """Return a hint that ``value`` may be in a wrong unit, e.g. cm instead of m; else empty."""
        expected = self.usual or self.plausible
        if expected is None:
            return ""
        for name, size in MISTAKEN_UNITS.get(self.unit, ()):
            if within(value * size, expected):
                return f"in {name}? {value:g} {name} are {value * size:.4g} {self.unit}."
        return ""


def is_recorded(info: core_schema.ValidationInfo) -> bool:
    """Return True if the validated data is from a recording, whose ranges are not checked."""
    return info.context is not None and RECORDED in info.context


def within(value: Any, bounds: Range) -> bool:
    """Return True if |value| lies in the closed range ``bounds``, or if it is not a number."""
    return not isinstance(value, (int, float)) or bounds[0] <= abs(value) <= bounds[1]


def key_of(field: FieldInfo) -> Key | None:
    """Return the `Key` in a pydantic field's annotation; None if it has none."""
    return next((m for m in field.metadata if isinstance(m, Key)), None)


class Section(BaseModel):
    """Base class of pydantic models of TOML tables: immutable; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    def __setattr__(self, name: str, value: Any) -> None:
        raise UsageError(
            f"{name} of a {type(self).__name__} cannot be set: profiles and plans are immutable.",
            cause="a changed copy is needed instead.",
            fix="data = profile.to_dict(); change data; heli3dof.profile_from_dict(data) "
            "(plans: plan_from_dict)",
        )


def section_of(field: FieldInfo) -> type[Section] | None:
    """Return the `Section` subclass S of a field of type S or ``S | None``; else None."""
    options = [field.annotation, *getattr(field.annotation, "__args__", ())]
    return next((o for o in options if isinstance(o, type) and issubclass(o, Section)), None)


def keys(model: type[Section], prefix: str = "") -> Iterator[tuple[str, FieldInfo]]:
    """Yield the dotted name and the pydantic field of every key of ``model``, in the order defined.

    ``prefix`` is put before each name.
    """
    for name, field in model.model_fields.items():
        inner = section_of(field)
        if inner is None:
            yield prefix + name, field
        else:
            yield from keys(inner, f"{prefix}{name}.")


def value_at(data: Any, name: str) -> Any:
    """Return the value of a dotted key such as ``motor.V_o`` in nested dicts or sections.

    The result is None if there is no such key.

    >>> value_at({"motor": {"V_o": 7.4}}, "motor.V_o")
    7.4
    """
    for part in name.split("."):
        data = data.get(part) if isinstance(data, Mapping) else getattr(data, part, None)
    return data


M = TypeVar("M", bound=BaseModel)


def read_toml(
    path: Path, what: str, error: type[UsageError], names: Collection[str] = ()
) -> dict[str, Any]:
    """Return the content of the TOML file ``path`` as nested dicts.

    Raises an exception of the class ``error`` if the file cannot be read; ``what``, for example
    "profile", is the kind of file that the message names.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise no_file(path, what, error, names) from None
    except UnicodeDecodeError:
        raise error(
            f"{path} is not a {what}: it is not a text file in UTF-8.",
            cause="it is another kind of file (a recording?), or its text has another encoding.",
            fix=f"give a {what} file (.toml)",
        ) from None
    except OSError as problem:
        raise error(
            f"The {what} {path} cannot be read: {problem.strerror}.",
            cause="it is a folder, or not readable for you.",
            fix=f"ls -l {quoted(path)}",
        ) from problem
    except (tomllib.TOMLDecodeError, RecursionError) as problem:
        cause, fix = _syntax_advice(path, str(problem))
        raise error(
            f"The {what} {path} is not valid TOML: {problem}.", cause=cause, fix=fix
        ) from problem
    kind = toml_kind(data)
    if kind not in (None, what):
        raise error(
            f"{path} is a {kind}, not a {what}.",
            cause="another file was meant.",
            fix=toml_use(path, kind),
        )
    return data


def _syntax_advice(path: Path, problem: str) -> tuple[str, str]:
    """Return likely cause and fix of tomllib's error message ``problem``, which names a line."""
    if (place := re.search(r"at line (\d+)", problem)) is not None:
        line = path.read_text(encoding="utf-8-sig").split("\n")[int(place[1]) - 1].strip()
        if number := re.search(r"=\s*([+-]?\d+),(\d+)", line):
            return (
                f"a decimal comma in {line!r}; TOML needs a decimal point.",
                f"write {number[1]}.{number[2]} in line {place[1]} of {path}",
            )
    return "a missing quote, bracket or equals sign.", f"edit {path}"


@dataclass(frozen=True)
class Problem:
    """An error in a TOML file: dotted ``key`` (empty: whole file), what is wrong, cause, fix."""

    key: str
    what: str
    cause: str
    fix: str


def check(
    model: type[M],
    data: Mapping[str, Any],
    source: str,
    error: type[UsageError],
    *,
    recorded: bool = False,
) -> M:
    """Return an instance of ``model`` with the values in the nested dicts ``data``.

    Raises one ``error`` that names every wrong key. ``source`` names the file in messages.
    ``recorded``: the data is from a recording or a model file, so `Key.plausible` is not checked.
    """
    try:
        return model.model_validate(data, context={RECORDED: True} if recorded else None)
    except ValidationError as problem:
        problems = problems_of(problem, model, source)
    first = problems[0]
    if len(problems) == 1:
        raise error(f"{source}: {first.what}.", cause=first.cause, fix=first.fix)
    lines = [p.what + (f" ({p.cause})" if "?" in p.cause else "") for p in problems]
    raise error(
        "\n  ".join([f"{source}: {len(problems)} keys are wrong:", *lines]),
        cause="see each key." if len({p.cause for p in problems}) > 1 else first.cause,
        fix=first.fix if len({p.fix for p in problems}) == 1 else f"edit {source}",
    )


def problems_of(problem: ValidationError, model: type[BaseModel], source: str) -> list[Problem]:
    """Return all errors: unknown keys first, one entry for all missing keys, then wrong values.

    ``problem`` is pydantic's error for ``model``, ``source`` the file's name. A misspelt key would
    count twice, as unknown and as missing; it is reported only as unknown.
    """
    errors = problem.errors(include_url=False)
    out: list[Problem] = []
    misspelt = set()
    missing = list[tuple[str, ...]]()
    for e in errors:
        path = tuple(str(part) for part in e["loc"])
        if e["type"] == "missing" and not _is_short_list(e):
            missing.append(path)
        if e["type"] != "extra_forbidden":
            continue
        known, where = _keys_at(model, path[:-1])
        if (meant := nearest(path[-1], known)) is not None:
            misspelt.add((*path[:-1], meant))
        out.append(
            Problem(
                ".".join(path),
                f"unknown key {'.'.join(path)!r}",
                f"a typing error; {did_you_mean(path[-1], known)}",
                f"edit {source}; keys {where}: {', '.join(known)}",
            )
        )
    missing = [path for path in missing if path not in misspelt]
    if missing:
        out.append(_missing_keys([n for p in missing for n in _required(model, p)],
                                 *_keys_at(model, missing[0][:-1]), source))  # fmt: skip
    out += [
        _wrong_value(e, source)
        for e in errors
        if e["type"] not in ("extra_forbidden", "missing") or _is_short_list(e)
    ]
    return out


def _is_short_list(e: ErrorDetails) -> bool:
    """Return True if pydantic's error ``e`` means that a list of fixed length has too few values.

    pydantic gives this error the same type as that of a missing key.
    """
    return e["type"] == "missing" and isinstance(e["loc"][-1], int)


def _missing_keys(names: list[str], known: list[str], where: str, source: str) -> Problem:
    if len(names) == 1:
        what = f"the key {names[0]!r} is missing"
        fix = f"add it to {source}; keys {where}: {', '.join(known)}"
    else:
        what = f"the keys {', '.join(map(repr, names))} are missing"
        fix = f"add them to {source}"
    cause = "it is incomplete, or written for another version."
    return Problem(names[0], what, cause, fix)


def _wrong_value(e: ErrorDetails, source: str) -> Problem:
    name = ".".join(str(part) for part in (e["loc"][:-1] if _is_short_list(e) else e["loc"]))
    what = e["msg"]
    shapes = {
        "missing": "has too few values",
        "too_long": f"must have {e.get('ctx', {}).get('max_length')} values",
        "tuple_type": "must be a list of values",
    }
    if e["type"] in shapes:
        return Problem(
            name,
            f"{name} = {e['input']!r} {shapes[e['type']]}",
            "a value was left out or added, or brackets are missing.",
            f"edit {source}",
        )
    if e["type"] in ("model_type", "model_attributes_type", "dict_type"):
        return Problem(
            name,
            f"{name or 'the content'} = {e['input']!r} is not a table of keys",
            "a value where a table (in Python a dict) belongs.",
            f"edit {source}",
        )
    if e["type"] == "list_type" and isinstance(e["input"], dict):
        return Problem(
            name,
            f"{name} is one table; it must be a list of tables",
            f"single brackets, [{name}], around the name of a table of a list.",
            f"write [[{name}]] in {source}",
        )
    if e["type"] != "conflict":
        verb = "is" if e["type"] == "implausible" else "cannot be:"
        what = f"{name or 'the file'} = {e['input']!r} {verb} {what}"
    unit = str(e.get("ctx", {}).get("slip", ""))
    cause = unit or "a wrong unit or sign, or text where a number belongs."
    return Problem(name, what, cause, f"edit {source}")


def _required(model: type[BaseModel], path: Sequence[str]) -> list[str]:
    """Return the dotted names of the keys that are missing if ``path`` is missing.

    If ``path`` is a section, these are the keys that the section requires; else only ``path``.
    """
    field = _section_at(model, path[:-1])[0].model_fields.get(path[-1])
    inner = None if field is None else section_of(field)
    if inner is None:
        return [".".join(path)]
    return [".".join([*path, n]) for n, f in inner.model_fields.items() if f.is_required()]


def _keys_at(model: type[BaseModel], path: Sequence[str]) -> tuple[list[str], str]:
    """Return the keys of the section at ``path``, and the section in words: "in [motor]"."""
    section, name = _section_at(model, path)
    return list(section.model_fields), f"in [{name}]" if name else "at the top level"


def _section_at(model: type[BaseModel], path: Sequence[str]) -> tuple[type[BaseModel], str]:
    """Return class and dotted name of the deepest TOML table on ``path``, starting at ``model``."""
    names: list[str] = []
    for part in path:
        field = model.model_fields.get(part)
        inner = None if field is None else section_of(field)
        if inner is None:
            break
        model = inner
        names.append(part)
    return model, ".".join(names)
