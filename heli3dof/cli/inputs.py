"""Recordings and models that a verb was given, told apart and loaded with their warnings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from heli3dof.cli.output import Talk

if TYPE_CHECKING:
    from heli3dof.identification.identify import Identification
    from heli3dof.model.base import Model
    from heli3dof.recording.recording import Recording


def load_all(talk: Talk, paths: Sequence[Path], profile: Path | None) -> list[Recording]:
    """Load every recording; say aloud what is odd about each."""
    from heli3dof.errors import RecordingError
    from heli3dof.recording.load import load
    from heli3dof.rig.profile import load_profile

    chosen = load_profile(profile) if profile else None
    loaded = []
    for path in paths:
        if path.suffix in (".json", ".toml") and path.is_file():
            raise RecordingError(
                f"{path} is no recording: its name is that of a "
                f"{'model file' if path.suffix == '.json' else 'profile or a plan'}.",
                cause="a file of another kind stands where recordings are expected.",
                fix=f"heli3dof compare REC... {path}, to judge a model"
                if path.suffix == ".json" else f"--profile {path}, or heli3dof run {path}",
            )  # fmt: skip
        recording = load(path, chosen)
        for warning in recording.meta.get("warnings", ()):
            talk.warn(f"{path.name}: {warning}")
        loaded.append(recording)
    return loaded


def distinct(train: Sequence[Recording], holdout: Sequence[Recording]) -> None:
    """Raise UsageError for a flight that is given twice, by what it holds and not by its name.

    Twice among the first it would count twice; in ``holdout`` it would confirm itself.
    """
    from heli3dof.errors import UsageError

    fitted = {r.digest: r.name for r in train}
    for r in holdout:
        if r.digest in fitted:
            raise UsageError(
                f"{r.name} holds the very samples of {fitted[r.digest]}, which is fitted: it is "
                "no hold-out.",
                cause="the same file, or a copy of it, stands on both sides of --holdout.",
                fix="hold out another flight (heli3dof run rich --seed 2 makes one), or leave "
                "--holdout away: the gain is then measured on blocks left out",
            )
    if len(fitted) < len(train):
        names = [r.name for r in train]
        raise UsageError(
            f"The same samples are given twice among {', '.join(names)}.",
            cause="a file was named twice, or one is a copy of another.",
            fix="name every flight once",
        )


def one_rig(recordings: Sequence[Recording]) -> None:
    """Raise UsageError for recordings whose profiles are of different rigs: none is of both.

    Body, thrust gain and encoders make a rig; loop, limits and rest angles may change in between.
    """
    from heli3dof.errors import UsageError

    rigs = [_body(r) for r in recordings]
    for r, rig in zip(recordings, rigs, strict=True):
        other = [k for k, v in rig.items() if v != rigs[0][k]]
        if other:
            key = other[0]
            raise UsageError(
                f"{r.name} is of another rig than {recordings[0].name}: {key} = {rig[key]:g} and "
                f"{rigs[0][key]:g} in their profiles"
                + (f" (and {len(other) - 1} more)." if other[1:] else "."),
                cause="flights of two rigs were given together, or a profile was corrected in "
                "between.",
                fix="give those of one rig; or --profile FILE.toml, if it was one and the same",
            )


def _body(r: Recording) -> dict[str, float]:
    """The profile's numbers that belong to the rig and no other."""
    p = r.profile
    parts = {"geometry": p.geometry, "mass": p.mass}
    out = {f"{k}.{n}": float(v) for k, part in parts.items() for n, v in part}
    out["motor.K_f"] = p.motor.K_f
    for axis in ("roll", "pitch", "yaw"):
        out[f"encoder.{axis}"] = float(getattr(p.encoder, axis))
        out[f"inertia.{axis}"] = getattr(p.inertia, axis, None) or 0.0  # 0: the masses'
    return out


def split(words: Sequence[str]) -> tuple[list[Path], list[str]]:
    """Recordings, and models by name or file, among the arguments of a verb."""
    from heli3dof.errors import UsageError
    from heli3dof.paper.models import BUILT_IN

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
    from heli3dof.paper.models import load_model

    return [load_model(name, recording.profile) for name in names]


def with_shipped() -> tuple[list[Recording], list[Model]]:
    """The recordings that ship to compare with, and what is identified from the others."""
    from heli3dof_recordings import references

    from heli3dof.recording.mcap_files.reader import read_recording

    train = [read_recording(r.path) for r in references() if r.use == "identify"]
    test = [read_recording(r.path) for r in references() if r.use == "compare"]
    return test, [found.model for found in both(train, test)]


def both(train: Sequence[Recording], test: Sequence[Recording]) -> list[Identification]:
    """A black box, as the paper identified one, and the grey box, from the same recordings."""
    from heli3dof.identification.identify import identify

    return [
        identify(train, holdout=test, method=method, name=name)
        for method, name in (("pem", "identification"), ("greybox", "grey box"))
    ]
