"""`export`: writes a recording or a model in the format of another program."""

from __future__ import annotations

from pathlib import Path

from heli3dof.errors import UsageError, quoted
from heli3dof.model.base import Model
from heli3dof.model.mat_file import save_mat
from heli3dof.recording.logs import export as recordings
from heli3dof.recording.recording import Recording


def export(source: Recording | Model, path: str | Path, *, force: bool = False) -> Path:
    """Write a recording or a model in the format of the file's ending, and return the path.

    A recording becomes a table (``.csv``, ``.csv.gz``, ``.mat``, ``.parquet``) or a viewer's file
    (``.mcap``, ``.rrd``, ``.xml``); a model becomes a state-space model for MATLAB (``.mat``).

    Raises OutputExists (without ``force``), UsageError (unknown ending; the library for Parquet or
    Rerun is not installed), NoSpace, or CheckFailed if a nonlinear model cannot hover level.
    """
    if isinstance(source, Recording):
        return recordings.export(source, path, force=force)
    check_model_format(Path(path))
    return save_mat(source, path, force=force)


def check_model_format(path: Path, source: Path = Path("MODEL.json")) -> None:
    """Raise UsageError unless ``path`` ends in ``.mat``; ``source`` is the model's file."""
    if path.suffix.lower() != ".mat":
        raise UsageError(
            f"A model can be exported as .mat only, not as {path.name}.",
            cause="the other formats are tables of a recording, or viewers of one.",
            fix=f"heli3dof export {quoted(source)} -o {quoted(path.stem)}.mat",
        )
