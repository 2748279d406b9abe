"""Recordings and models that a verb was given, told apart and loaded with their warnings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from heli3dof.cli.console import Talk

if TYPE_CHECKING:
    from heli3dof.identification.api import Identification
    from heli3dof.model.base import Model
    from heli3dof.recording.recording import Recording


def load_all(talk: Talk, paths: Sequence[Path], profile: Path | None) -> list[Recording]:
    """Load every recording; say aloud what is odd about each."""
    from heli3dof.recording.load import load
    from heli3dof.rig.profile import load_profile

    chosen = load_profile(profile) if profile else None
    loaded = []
    for path in paths:
        recording = load(path, chosen)
        for warning in recording.meta.get("warnings", ()):
            talk.warn(f"{path.name}: {warning}")
        loaded.append(recording)
    return loaded


def split(words: Sequence[str]) -> tuple[list[Path], list[str]]:
    """Recordings, and models by name or file, among the arguments of a verb."""
    from heli3dof.errors import UsageError
    from heli3dof.model.modelfile import BUILT_IN

    models = [w for w in words if w in BUILT_IN or w.endswith(".json")]
    recordings = [Path(w) for w in words if w not in models]
    if not recordings:
        raise UsageError(
            f"There is no recording among: {' '.join(words)}.",
            cause="models were named, but nothing to compare them with.",
            fix=f"heli3dof compare REC.mcap {' '.join(models)}, or heli3dof compare alone",
        )
    return recordings, models


def models_for(names: Sequence[str], recording: Recording) -> list[Model]:
    """The named models: built-in ones are made from the recording's own profile."""
    from heli3dof.model.modelfile import load_model

    return [load_model(name, recording.profile) for name in names]


def with_shipped() -> tuple[list[Recording], list[Model]]:
    """The recordings that ship to compare with, and what is identified from the others."""
    from heli3dof_recordings import references

    from heli3dof.recording.reader import read_recording

    train = [read_recording(r.path) for r in references() if r.use == "identify"]
    test = [read_recording(r.path) for r in references() if r.use == "compare"]
    return test, [found.model for found in both(train, test)]


def both(train: Sequence[Recording], test: Sequence[Recording]) -> list[Identification]:
    """A black box, as the paper identified one, and the grey box, from the same recordings."""
    from heli3dof.identification.api import identify

    return [
        identify(train, holdout=test, method=method, name=name)
        for method, name in (("pem", "identification"), ("greybox", "grey box"))
    ]
