"""TOML files that people write: read, checked against a model, and explained where wrong.

Profiles and plans share this. An unknown, missing or impossible key is an error that names the key,
the file and the nearest known key; all such errors of a file are reported at once. `Key` gives a
field its meaning, unit, ranges and how it is measured: errors, prompts, comments in written files
and the documentation's tables all come from it.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError, core_schema

from heli3dof.errors import UsageError, did_you_mean, nearest

Positive = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]

RECORDED = "recorded"
"""Key of pydantic's context: the data was accepted once and is read back, whatever its ranges."""

Range = tuple[float, float]

SLIPS: Mapping[str, tuple[tuple[str, float], ...]] = {
    "m": (("centimetres", 0.01), ("millimetres", 0.001), ("inches", 0.0254)),
    "kg": (("grams", 0.001), ("pounds", 0.4536)),
    "kg·m²": (("kg·cm²", 1e-4), ("g·m²", 1e-3)),
    "N/V": (("gram-force per volt", 0.00981), ("mN/V", 0.001)),
    "V": (("millivolts", 0.001),),
    "Hz": (("kilohertz", 1000.0),),
    "°": (("radians", 57.29578),),
    "s": (("milliseconds", 0.001),),
}
"""unit → (what was typed instead, its size in that unit)"""


@dataclass(frozen=True)
class Key:
    """What a key of a TOML file means. Ranges are closed, in ``unit``, of the number's size."""

    meaning: str
    unit: str = "–"
    measure: str = ""
    """How to measure or choose it"""
    typical: str = ""
    """What it is on a common rig, for a prompt"""
    usual: Range | None = None
    """Outside it the number is legal but unusual."""
    plausible: Range | None = None
    """Outside it the number is refused."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.with_info_after_validator_function(self._checked, handler(source))

    def _checked(self, value: Any, info: core_schema.ValidationInfo) -> Any:
        recorded = info.context is not None and RECORDED in info.context
        if not recorded and self.plausible is not None and not within(value, self.plausible):
            low, high = self.plausible
            raise PydanticCustomError(
                "implausible",
                "not plausible; the range is {low} to {high} {unit}",
                {
                    "low": f"{low:g}",
                    "high": f"{high:g}",
                    "unit": self.unit,
                    "slip": self.slip(value),
                },
            )
        return value

    def slip(self, value: float) -> str:
        """The unit that was likely meant, as a sentence; empty where no other unit fits."""
        expected = self.usual or self.plausible
        if expected is None:
            return ""
        for name, size in SLIPS.get(self.unit, ()):
            if within(value * size, expected):
                return f"in {name}? {value:g} {name} are {value * size:.4g} {self.unit}."
        return ""


def within(value: Any, bounds: Range) -> bool:
    """Whether the size of a number lies in a range; what is no number does."""
    return not isinstance(value, (int, float)) or bounds[0] <= abs(value) <= bounds[1]


def key_of(field: FieldInfo) -> Key | None:
    """What a field's annotation says of it."""
    return next((m for m in field.metadata if isinstance(m, Key)), None)


class Section(BaseModel):
    """A table of a TOML file: immutable, and no key that it does not know."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def section_of(field: FieldInfo) -> type[Section] | None:
    """The section that a field holds, optional or not; None for a plain value."""
    options = [field.annotation, *getattr(field.annotation, "__args__", ())]
    return next((o for o in options if isinstance(o, type) and issubclass(o, Section)), None)


def keys(model: type[Section], prefix: str = "") -> Iterator[tuple[str, FieldInfo]]:
    """Dotted name and field of every key, sections' in their order."""
    for name, field in model.model_fields.items():
        inner = section_of(field)
        if inner is None:
            yield prefix + name, field
        else:
            yield from keys(inner, f"{prefix}{name}.")


M = TypeVar("M", bound=BaseModel)


def read_toml(path: Path, what: str, error: type[UsageError]) -> dict[str, Any]:
    """The file's content as nested dicts; ``what`` ("profile") names it in errors."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise error(
            f"There is no {what} {path}.",
            cause="a typing error in the path, or another working directory.",
            fix=f"ls {path.parent}",
        ) from None
    except (OSError, UnicodeDecodeError) as problem:
        raise error(
            f"The {what} {path} cannot be read: {problem}.",
            cause="it is a folder, not text, or not yours to read.",
            fix=f"ls -l {path}",
        ) from problem
    except (tomllib.TOMLDecodeError, RecursionError) as problem:
        raise error(
            f"The {what} {path} is not valid TOML: {problem}.",
            cause="a missing quote, bracket or equals sign.",
            fix=f"edit {path}",
        ) from problem


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong in a file; ``key`` is dotted, empty for the file as a whole."""

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
    """Build ``model`` from nested dicts; raise ``error`` naming every wrong key.

    ``recorded``: data that an earlier version accepted, read back from a recording or a model
    file; implausible numbers are no reason to lose it.
    """
    try:
        return model.model_validate(data, context={RECORDED: True} if recorded else None)
    except ValidationError as problem:
        found = problems_of(problem, model, source)
    first = found[0]
    if len(found) == 1:
        raise error(f"{source}: {first.what}.", cause=first.cause, fix=first.fix)
    raise error(
        f"{source}: {len(found)} keys are wrong:"
        + "".join(f"\n  {p.what}" + (f" ({hint})" if (hint := _hint(p)) else "") for p in found),
        cause="see each key." if len({p.cause for p in found}) > 1 else first.cause,
        fix=first.fix if len({p.fix for p in found}) == 1 else f"edit {source}",
    )


def _hint(p: Problem) -> str:
    return p.cause if "?" in p.cause else ""


def problems_of(problem: ValidationError, model: type[BaseModel], source: str) -> list[Problem]:
    """All that is wrong, unknown keys first, then missing ones in one entry, then values.

    A misspelt key is both unknown and missing; only the unknown one is reported.
    """
    errors = problem.errors(include_url=False)
    unknown = [e["loc"] for e in errors if e["type"] == "extra_forbidden"]
    out: list[Problem] = []
    misspelt = set()
    for loc in unknown:
        *above, name = (str(part) for part in loc)
        section, known = _known_keys(model, above)
        if (meant := nearest(name, known)) is not None:
            misspelt.add((*above, meant))
        where = f"in [{section}]" if section else "at the top level"
        out.append(
            Problem(
                ".".join([*above, name]),
                f"unknown key {'.'.join([*above, name])!r}",
                f"a typing error; {did_you_mean(name, known)}",
                f"edit {source}; keys {where}: {', '.join(known)}",
            )
        )
    missing = [tuple(str(part) for part in e["loc"]) for e in errors if e["type"] == "missing"]
    missing = [loc for loc in missing if loc not in misspelt]
    if missing:
        names = [name for loc in missing for name in _required(model, list(loc))]
        section, known = _known_keys(model, list(missing[0][:-1]))
        where = f"in [{section}]" if section else "at the top level"
        one = len(names) == 1
        out.append(
            Problem(
                names[0],
                f"the key {names[0]!r} is missing"
                if one
                else f"the keys {', '.join(repr(n) for n in names)} are missing",
                "the file was cut short or written for another version.",
                f"add it to {source}; keys {where}: {', '.join(known)}"
                if one
                else f"add them to {source}",
            )
        )
    for e in errors:
        if e["type"] in ("extra_forbidden", "missing"):
            continue
        name = ".".join(str(part) for part in e["loc"])
        slip = str(e.get("ctx", {}).get("slip", ""))
        verb = "is" if e["type"] in ("implausible", "conflict") else "cannot be:"
        shown = f"{name or 'the file'} = {e['input']!r} " if e["type"] != "conflict" else ""
        out.append(
            Problem(
                name,
                f"{shown}{verb if shown else ''} {e['msg']}".strip(),
                slip or "a wrong unit or sign, or text where a number belongs.",
                f"edit {source}",
            )
        )
    return out


def _required(model: type[BaseModel], loc: list[str]) -> list[str]:
    """The keys that are missing with ``loc``: itself, or a section's required ones."""
    field = _model_at(model, loc[:-1]).model_fields.get(loc[-1])
    inner = None if field is None else section_of(field)
    if inner is None:
        return [".".join(loc)]
    return [".".join([*loc, n]) for n, f in inner.model_fields.items() if f.is_required()]


def _model_at(model: type[BaseModel], path: list[str]) -> type[BaseModel]:
    for part in path:
        field = model.model_fields.get(part)
        inner = None if field is None else section_of(field)
        if inner is None:
            break
        model = inner
    return model


def _known_keys(model: type[BaseModel], path: list[str]) -> tuple[str, list[str]]:
    """The section that a path leads to, and its keys."""
    names: list[str] = []
    for part in path:
        field = model.model_fields.get(part)
        inner = None if field is None else section_of(field)
        if inner is None:
            break
        model = inner
        names.append(part)
    return ".".join(names), list(model.model_fields)
