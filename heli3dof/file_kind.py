"""Explain in error messages that a file has the wrong kind, or that it does not exist.

`other_file` recognises the kind of a TOML or JSON file by its content. `no_file` suggests the most
similar name if a file does not exist.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Collection, Mapping
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

from heli3dof.errors import Heli3dofError, UsageError, quoted

TOML_KINDS = {
    "plan": (("segment",), "heli3dof run {}"),
    "sweep": (("vary", "design"), "heli3dof batch run --sweep {}"),
    "profile": (("geometry", "mass", "motor", "encoder", "loop"), "--profile {}"),
}
"""Kind of a TOML file → the top-level keys that only this kind has, and how it is used"""
VERBS = {"diagnosis": "diagnose", "identification": "identify", "comparison": "compare"}
"""Schema of a JSON document → the verb that prints it with ``--json``"""
NOT_RECORDINGS = (".toml", ".json", ".html", ".txt")
SIMILAR = 0.6
"""Least similarity (0 to 1) of a suggested name; the default of Python's difflib"""


def toml_kind(data: Mapping[str, Any]) -> str | None:
    """Return the key of `TOML_KINDS` for a TOML file's content; None for other content."""
    return next((k for k, (keys, _) in TOML_KINDS.items() if any(n in data for n in keys)), None)


def toml_use(path: Path, kind: str) -> str:
    """Return the command or option that uses the TOML file at ``path`` of this ``kind``."""
    return TOML_KINDS[kind][1].format(quoted(path))


def other_file(path: Path) -> tuple[str, str] | None:
    """Return what a TOML or JSON file is, and what to give or run instead.

    Both values are texts for an error message. The result is None for a file with another ending.
    """
    if path.suffix == ".toml":
        kind = toml_kind(_content(path))
        uses = [toml_use(path, k) for k in ([kind] if kind else ["profile", "plan"])]
        return f"a {kind or 'profile or a plan'}", ", or ".join(uses)
    if path.suffix != ".json":
        return None
    data = _content(path)
    schema = _schema(data)
    if schema == "model":
        return "a model file", f"heli3dof compare REC... {quoted(path)}, to compare a model"
    if schema not in VERBS:
        return f"a JSON file of heli3dof ({schema})" if schema else "a JSON file", "another file"
    models = [quoted(model) for model in model_files(data)]
    fixes = ["the recordings themselves: REC.mcap"]
    fixes += [f"their model: heli3dof compare REC.mcap {' '.join(models)}"] if models else []
    return f"the output of heli3dof {VERBS[schema]} --json", "; ".join(fixes)


def model_files(document: Mapping[str, Any]) -> list[str]:
    """Return the paths of the model files that are named in ``document``.

    ``document``: JSON output of a subcommand in `VERBS`, such as ``heli3dof diagnose --json``.
    """
    models = document.get("models", [])
    named = [m.get("file") for m in models if isinstance(m, dict)] if models else []
    return [str(path) for path in [document.get("model"), *named] if path]


def no_file(
    path: Path,
    kind: str = "file",
    error: type[Heli3dofError] = UsageError,
    names: Collection[str] = (),
) -> Heli3dofError:
    """Return an ``error`` which states that ``path`` is not an existing file of this ``kind``.

    The error suggests the most similar name: one of ``names``, or a file of this kind in the folder
    of ``path``. ``names`` are names that a user can give instead of a path, for example those of
    the built-in plans. The comparison ignores upper case and file endings. Without a similar name,
    the error lists ``names`` or suggests the command ``ls``.
    """
    found = list(path.parent.iterdir()) if path.parent.is_dir() else []
    known: list[str | Path] = [*names, *(p for p in found if p.is_file())]

    def similarity(other: str | Path) -> tuple[float, float]:
        pairs = (path.stem, Path(other).stem), (path.name, Path(other).name)
        stems, whole = (SequenceMatcher(None, a.lower(), b.lower()).ratio() for a, b in pairs)
        return stems, whole

    similar = sorted((n for n in known if similarity(n)[0] >= SIMILAR), key=similarity)
    near = next((n for n in reversed(similar) if isinstance(n, str) or _may_be(n, kind)), None)
    if near is not None:
        shown = repr(near) if isinstance(near, str) else near
        cause, fix = f"a typing error; did you mean {shown}?", f"again with {quoted(near)}"
    else:
        cause = "a typing error in the path, or another working directory."
        fix = (
            f"one of: {', '.join(names)}"
            if names and len(path.parts) == 1
            else f"ls {quoted(path.parent)}"
        )
    return error(f"There is no {kind} {path}.", cause=cause, fix=fix)


def _may_be(path: Path, kind: str) -> bool:
    """Return False for a file that is of another kind than ``kind``."""
    ending = path.suffix.lower()
    if kind in TOML_KINDS:
        return ending == ".toml" and toml_kind(_content(path)) in (kind, None)
    if kind == "model file":
        return ending == ".json" and _schema(_content(path)) == "model"
    return kind == "file" or ending not in NOT_RECORDINGS


def _content(path: Path) -> dict[str, Any]:
    """Return the content of a TOML or JSON file; empty for a faulty file."""
    try:
        text = path.read_text(encoding="utf-8-sig")
        data = tomllib.loads(text) if path.suffix.lower() == ".toml" else json.loads(text)
    except (OSError, ValueError, RecursionError):
        return {}
    return data if isinstance(data, dict) else {}


def _schema(document: Mapping[str, Any]) -> str:
    """Return the name of a JSON document's schema without its version, such as ``diagnosis``.

    The result is an empty string if the document has no schema of heli3dof.
    """
    owner, _, schema = str(document.get("schema")).partition("/")[0].partition(".")
    return schema if owner == "heli3dof" else ""
