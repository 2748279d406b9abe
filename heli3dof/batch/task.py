"""`Task`: one run of a verb (subcommand) on one recording. `Outcome`: its result.

Both are sent between processes. The key of a task is a hash of all that its result depends on:

- the verb and its options
- the profile, and the recording's content and name
- the version of heli3dof, with a hash of its code
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import heli3dof
from heli3dof.errors import CheckFailed, NoSpace, RecordingError
from heli3dof.rig.profile import Profile

KEY_SHOWN = 12
"""Hexadecimal digits of the key in the names of files: 48 bits, so that among 10⁶ recordings of the
same name two have the same digits with a probability of 0.2 %"""
ENDINGS = (".py", ".toml", ".json")
"""Endings of the files that the hash in the version covers"""


@dataclass(frozen=True)
class Task:
    """One run of a verb (subcommand) on one recording, or one flight of a sweep.

    A flight of a sweep has the verb ``run`` and an empty ``source``.
    """

    verb: str
    key: str
    """The task's key, computed by `new`"""
    name: str
    """The recording's name: that of its file without the ending"""
    source: str = ""
    """Path or URL of the recording as the user gave it; empty in a sweep"""
    options: Mapping[str, Any] = field(default_factory=dict)
    """The verb's options: name → value of a JSON type"""
    profile: Profile | None = None
    """The profile for logs, which contain none"""
    where: str = ""
    """Condition of ``--where``; a recording that does not meet it is left out. Empty: none"""
    content: bytes | None = None
    """The file's content, for a worker that cannot read it itself"""

    @classmethod
    def new(
        cls, verb: str, name: str, options: Mapping[str, Any], profile: Profile | None, *,
        source: str = "", fingerprint: str = "", where: str = "",
    ) -> Task:  # fmt: skip
        """Return a task whose key is the SHA-256 (hexadecimal) of all that its result depends on.

        ``fingerprint``: hash of the recording's content.
        """
        parts = {
            "verb": verb, "name": name, "content": fingerprint, "options": options,
            "version": code_version(), "profile": None if profile is None else profile.to_dict(),
        }  # fmt: skip
        text = json.dumps(parts, sort_keys=True, ensure_ascii=False, default=str)
        key = hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()
        return cls(verb, key, name, source, options, profile, where)

    @property
    def label(self) -> str:
        """Return the name of this task's files in the output folder."""
        return f"{self.name}-{self.key[:KEY_SHOWN]}"


@dataclass(frozen=True)
class Outcome:
    """The result of a task that succeeded or failed."""

    key: str
    row: Mapping[str, Any]
    """Column → value of the results table"""
    document: Mapping[str, Any]
    """What the verb prints with ``--json``"""
    files: Mapping[str, bytes] = field(default_factory=dict)
    """Path relative to the output folder → content: models, recordings"""
    selected: bool = True
    """False if the recording does not meet the condition ``where``"""
    is_final: bool = True
    """False if the same task may succeed when it is tried again: after a crash or a full disk"""
    cost: Mapping[str, float] = field(default_factory=dict)
    """Seconds and bytes that the task needed; they differ from run to run."""


@cache
def code_version() -> str:
    """Return the version and 12 digits of the code's SHA-256, as in 0.1.0+1f0c5a7e93b2.

    A resumed batch repeats the tasks whose results were computed by other code.
    """
    folder = Path(heli3dof.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(p for p in folder.rglob("*") if p.suffix in ENDINGS):
        digest.update(path.relative_to(folder).as_posix().encode())
        digest.update(path.read_bytes())
    return f"{metadata.version('heli3dof')}+{digest.hexdigest()[:12]}"


def is_final(error: BaseException) -> bool:
    """Return True if the recording is the cause of ``error``, so that the task would fail again.

    >>> is_final(RecordingError("torn")), is_final(NoSpace("full")), is_final(MemoryError())
    (True, False, False)
    """
    return isinstance(error, (RecordingError, CheckFailed)) and not isinstance(error, NoSpace)
