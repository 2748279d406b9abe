"""``heli3dof export``: writes a recording or a model for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from heli3dof.cli.options import Columns, Force, LogProfile, OutputFile, log_profile
from heli3dof.cli.output import Output, verb
from heli3dof.errors import UsageError, did_you_mean, quoted

Source = Annotated[
    Path, typer.Argument(metavar="REC", help="A recording, a log, or a model file (.json).")
]
To = Annotated[
    str | None,
    typer.Option(
        "--to",
        metavar="FORMAT",
        help="csv, mat, parquet, or a viewer: foxglove, plotjuggler, rerun. "
        "Default: by the name of -o, else csv; mat for a model.",
    ),
]
OPEN = {
    ".mcap": "Open it in Foxglove, and import the layout {layout}.",
    ".rrd": "Open it: rerun {file}",
    ".xml": "Open it: plotjuggler -d {recording} -l {file}",
}
"""Ending → how to open the file in its viewer"""


def register(app: typer.Typer) -> None:
    app.command("export", rich_help_panel="Files")(export)


@verb
def export(
    out: Output,
    recording: Source,
    output: OutputFile = None,
    to: To = None,
    profile: LogProfile = None,
    columns: Columns = None,
    force: Force = False,
) -> None:
    """Convert a recording to a table or a viewer's format: heli3dof export REC --to foxglove.

    A model file (.json) becomes a state-space model for MATLAB: heli3dof export model.json.
    """
    from heli3dof.recording.atomic_write import check_outputs, write_file
    from heli3dof.recording.load import load
    from heli3dof.recording.logs.export import check_format, export, layout

    if _is_model(recording):
        _export_model(out, recording, output or recording.with_suffix(".mat"), to, force)
        return
    path = _path(recording, output, to)
    ending = path.suffix.lower()
    view = path.with_suffix(".foxglove.json") if ending == ".mcap" else None
    if ending == ".xml" and recording.suffix.lower() != ".mcap":
        raise UsageError(
            f"The layout for PlotJuggler does not fit {recording.name}.",
            cause="it names the topics of a recording (.mcap).",
            fix=f"heli3dof import {quoted(recording)} --profile PROFILE.toml "
            f"-o {quoted(recording.stem)}.mcap",
        )
    if recording.exists():
        check_outputs(path, view, force=force, inputs=[recording])
        check_format(path)
    loaded = load(recording, log_profile(profile), columns)
    written = export(loaded, path, force=force)
    document = {"schema": "heli3dof.export/1", "file": str(written), "samples": len(loaded)}
    out.note(f"Written: {written}" + (f", {len(loaded)} samples" if ending != ".xml" else ""))
    if view is not None:
        document["layout"] = str(write_file(view, layout("foxglove_layout.json"), force=force))
        out.note(f"Written: {view}")
    if ending in OPEN:
        named = {"file": path, "layout": view, "recording": recording}
        out.note(OPEN[ending].format(**{k: quoted(v) for k, v in named.items()}))
    out.emit(document)


def _path(recording: Path, output: Path | None, to: str | None) -> Path:
    """Return the file to write: ``output``, or the recording's name with the format's ending.

    Raises UsageError for an unknown format, or one that contradicts ``output``.
    """
    from heli3dof.recording.atomic_write import stem
    from heli3dof.recording.logs.export import ENDINGS

    if to is not None and to not in ENDINGS:
        raise UsageError(
            f"There is no export format {to!r}.",
            cause=f"a typing error; {did_you_mean(to, tuple(ENDINGS))}",
            fix=f"--to with one of {', '.join(ENDINGS)}",
        )
    ending = ENDINGS[to or "csv"]
    if output is None:
        return recording.with_name(stem(recording) + ending)
    suffix = Path("x" + ending).suffix
    if to is not None and not output.name.lower().endswith((suffix, f"{suffix}.gz")):
        raise UsageError(
            f"The format {to} has files named *{suffix}, not {output.name}.",
            cause="--to and -o name different formats.",
            fix="omit one of the two",
        )
    return output


def _is_model(path: Path) -> bool:
    """Return True for a .json file, unless it has the first bytes of an MCAP file."""
    from heli3dof.recording.mcap_files.mcap_writer import MAGIC

    if path.suffix != ".json" or not path.is_file():
        return False
    with path.open("rb") as stream:
        return stream.read(len(MAGIC)) != MAGIC


def _export_model(out: Output, source: Path, path: Path, to: str | None, force: bool) -> None:
    from heli3dof.model.export import check_model_format, export
    from heli3dof.model.model_file import read_model
    from heli3dof.recording.atomic_write import check_outputs

    check_model_format(path if to in (None, "mat") else Path(f"{path.stem}.{to}"), source)
    check_outputs(path, force=force, inputs=[source])
    model = read_model(source)
    written = export(model, path, force=force)
    out.note(f"Written: {written}, model {model.name}")
    out.emit({"schema": "heli3dof.export/1", "file": str(written), "model": model.name})
