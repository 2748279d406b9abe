"""Load and check the recordings and models that a subcommand's arguments name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from heli3dof.cli.options import log_profile
from heli3dof.cli.output import Output
from heli3dof.errors import RecordingError, UsageError, minus, nearest, quoted

if TYPE_CHECKING:
    from heli3dof.identification.identify import Identification
    from heli3dof.model.base import Model
    from heli3dof.recording.recording import Recording


def load_all(out: Output, paths: Sequence[Path], profile: Path | None) -> list[Recording]:
    """Load the recordings and logs at ``paths``, print their warnings, and return them.

    ``profile``: the file of the rig's profile, which a log needs. Raises RecordingError or
    UsageError for a file that cannot be used.
    """
    from heli3dof.recording.load import load
    from heli3dof.recording.provenance import PROFILE_FILE

    used = log_profile(profile)
    loaded = []
    for path in paths:
        try:
            recording = load(path, used)
        except RecordingError as error:
            complete_import_command(error, [path], profile)
            raise
        for warning in recording.meta.get("warnings", ()):
            out.warn(f"{path.name}: {warning}")
        meta = {**recording.meta, PROFILE_FILE: str(profile or path)}
        loaded.append(replace(recording, meta=meta))
    return loaded


def refuse_bad_data(recordings: Sequence[Recording]) -> None:
    """Raise RecordingError with the first fault that makes ``recordings`` bad data, if any."""
    from heli3dof.integrity import Kind, integrity

    for fault in integrity(recordings):
        if fault.kind == Kind.BAD_DATA:
            what, cause = minus(f"Bad data: {fault.sentence}"), minus(fault.cause)
            raise RecordingError(what, cause=cause, fix=fault.fix)


def complete_import_command(
    error: RecordingError,
    logs: Sequence[Path],
    profile: Path | None,
    output: Path | None = None,
    mapping: Mapping[str, str] | None = None,
) -> None:
    """Complete the command ``heli3dof import …`` that the message of ``error`` proposes.

    The function inserts the files ``logs``, ``profile`` and ``output``, and an option ``--map`` for
    each entry of ``mapping``: name of a column → expression that computes the column.
    """
    from heli3dof.recording.atomic_write import stem
    from heli3dof.recording.logs.known_names import IMPORT, as_options

    options = f" --profile {quoted(profile)}" if profile else ""
    options += f" -o {quoted(output or f'{stem(logs[0])}.mcap')}"
    options += f" {as_options(mapping)}" if mapping else ""
    command = f"heli3dof import {' '.join(map(quoted, logs))}{options}"
    error.fix = error.fix.replace(IMPORT, command)


def split(words: Sequence[str]) -> tuple[list[Path], list[str]]:
    """Split command-line arguments into paths of recordings and names of models.

    A model is a built-in name or a ``.json`` file. Raises UsageError if there is no recording.
    """
    from heli3dof.paper.models import BUILT_IN

    def is_model(word: str) -> bool:
        if word in BUILT_IN or word.endswith(".json"):
            return True
        is_file = bool(Path(word).suffix) or Path(word).exists()
        return not is_file and nearest(word, BUILT_IN) is not None  # a misspelt model name

    models = [w for w in words if is_model(w)]
    recordings = [Path(w) for w in words if w not in models]
    if not recordings:
        raise UsageError(
            f"There is no recording among: {' '.join(words)}.",
            cause="only models were given.",
            fix=f"heli3dof compare REC.mcap {' '.join(map(quoted, models))}, "
            "or heli3dof compare alone",
        )
    return recordings, models


def models_for(names: Sequence[str], recording: Recording) -> list[Model]:
    """Load models by built-in name or file; built-in ones get the rig profile of ``recording``."""
    from heli3dof.paper.models import load_model

    return [load_model(name, recording.profile) for name in names]


def are_supplied(recordings: Sequence[Recording]) -> bool:
    """Return True if all are recordings of the paper's experiment that come with heli3dof."""
    from heli3dof_recordings import references

    from heli3dof.recording.mcap_files.reader import read_recording

    named = {r.name: r.path for r in references()}
    return all(
        r.name in named and r.digest == read_recording(named[r.name]).digest for r in recordings
    )


def reference_comparison() -> tuple[list[Recording], list[Model]]:
    """Return the recordings and models that ``compare`` uses without arguments.

    The recordings come with heli3dof. The models are identified from other recordings of the same
    collection.
    """
    from heli3dof_recordings import references

    from heli3dof.recording.mcap_files.reader import read_recording

    train = [read_recording(r.path) for r in references() if r.use == "identify"]
    test = [read_recording(r.path) for r in references() if r.use == "compare"]
    return test, [result.model for result in identify_both(train, test)]


def identify_both(train: Sequence[Recording], test: Sequence[Recording]) -> list[Identification]:
    """Identify a black-box model (prediction-error method) and a grey-box model from ``train``.

    Both identifications are returned in this order; ``test`` contains the held-out recordings.
    """
    from heli3dof.identification.identify import identify

    return [
        identify(train, holdout=test, method=method, name=name)
        for method, name in (("pem", "black box"), ("greybox", "grey box"))
    ]
