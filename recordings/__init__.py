"""Reference recordings that come with heli3dof; Python imports them as ``heli3dof_recordings``.

All are flights of the emulated rig. ``recordings.toml`` has the command of each, with profile and
seed; ``python -m heli3dof_recordings.make`` makes them again.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class Reference:
    """A reference recording: its name, its use, and the command that makes it."""

    name: str
    use: str
    """``identify`` (models are fitted to it) or ``compare`` (models are compared with it)"""
    about: str
    command: tuple[str, ...]
    """The arguments of ``heli3dof``; paths are relative to this folder."""

    @property
    def path(self) -> Path:
        return FOLDER / f"{self.name}.mcap"


def references() -> tuple[Reference, ...]:
    """Return every reference recording, in the order of ``recordings.toml``."""
    data: dict[str, Any] = tomllib.loads((FOLDER / "recordings.toml").read_text(encoding="utf-8"))
    return tuple(
        Reference(r["name"], r["use"], r["about"], tuple(r["command"])) for r in data["recording"]
    )
