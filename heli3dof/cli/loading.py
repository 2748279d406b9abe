"""Recordings and models that a verb was given, told apart and loaded with their warnings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from heli3dof.cli.console import Talk

if TYPE_CHECKING:
    from heli3dof.recording.recording import Recording
    from heli3dof.rig.profile import Profile


def load_profile_option(profile: Path | None) -> Profile | None:
    """The profile of ``--profile``, or None."""
    from heli3dof.rig.profile import load_profile

    return load_profile(profile) if profile else None


def load_all(talk: Talk, paths: Sequence[Path], profile: Path | None) -> list[Recording]:
    """Load every recording; say aloud what is odd about each."""
    from heli3dof.recording.load import load

    chosen = load_profile_option(profile)
    loaded = []
    for path in paths:
        recording = load(path, chosen)
        for warning in recording.meta.get("warnings", ()):
            talk.warn(f"{path.name}: {warning}")
        loaded.append(recording)
    return loaded
