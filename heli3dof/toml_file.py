"""TOML files that people write: read, checked against a model, and explained where wrong.

Profiles and plans share this: an unknown, missing or impossible key is an error that names the
key, the file and the nearest known key.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from heli3dof.errors import UsageError, did_you_mean

Positive = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]


class Section(BaseModel):
    """A table of a TOML file: immutable, and no key that it does not know."""

    model_config = ConfigDict(extra="forbid", frozen=True)


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
    except tomllib.TOMLDecodeError as problem:
        raise error(
            f"The {what} {path} is not valid TOML: {problem}.",
            cause="a missing quote, bracket or equals sign.",
            fix=f"edit {path}",
        ) from problem


def check(model: type[M], data: Mapping[str, Any], source: str, error: type[UsageError]) -> M:
    """Build ``model`` from nested dicts; raise ``error`` naming the first wrong key."""
    try:
        return model.model_validate(data)
    except ValidationError as problem:
        raise _explain(problem, model, source, error) from None


def _explain(
    problem: ValidationError, model: type[BaseModel], source: str, error: type[UsageError]
) -> UsageError:
    # A misspelt key is both unknown and missing: the unknown one tells more.
    errors = problem.errors(include_url=False)
    first = min(errors, key=lambda e: e["type"] != "extra_forbidden")
    path = [str(part) for part in first["loc"]]
    key = ".".join(path)
    section, known = _known_keys(model, path[:-1])
    where = f"in [{section}]" if section else "at the top level"
    if first["type"] == "extra_forbidden":
        return error(
            f"{source}: unknown key {key!r}.",
            cause=f"a typing error; {did_you_mean(path[-1], known)}",
            fix=f"edit {source}; keys {where}: {', '.join(known)}",
        )
    if first["type"] == "missing":
        return error(
            f"{source}: the key {key!r} is missing.",
            cause="the file was cut short or written for another version.",
            fix=f"add it to {source}; keys {where}: {', '.join(known)}",
        )
    return error(
        f"{source}: {key or 'the file'} = {first['input']!r} cannot be: {first['msg']}.",
        cause="a wrong unit or sign, or text where a number belongs.",
        fix=f"edit {source}",
    )


def _known_keys(model: type[BaseModel], path: list[str]) -> tuple[str, list[str]]:
    names: list[str] = []
    for part in path:
        field = model.model_fields.get(part)
        if field is None:
            break
        options = [field.annotation, *getattr(field.annotation, "__args__", ())]
        inner = [o for o in options if isinstance(o, type) and issubclass(o, BaseModel)]
        if not inner:
            break
        model = inner[0]
        names.append(part)
    return ".".join(names), list(model.model_fields)
