"""``heli3dof import``: converts another program's log to a recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heli3dof.cli.options import Columns, Force, LogProfile, OutputFile, rig_profile
from heli3dof.cli.output import Output, verb
from heli3dof.errors import minus

if TYPE_CHECKING:
    from rich.table import Table

    from heli3dof.rig.profile import Profile

EXAMPLE = """Files of one flight can be given together. Without -o, import writes nothing: it
shows the name, source, unit and range of each column. The rows of a matrix x after the time are
x[1], x[2], …

Example: heli3dof import input.mat x_enc.mat --profile rig.toml -o step.mcap
--map 'v_front_V=(input[1]-input[2])/2' --map 'v_back_V=(input[1]+input[2])/2'
--map 'roll_deg=57.2958*x_enc[5]'

Here input[1] is the sum of the voltages, input[2] the difference back - front. If the
log contains the sum minus the sum at hover, add the sum at hover: (input[1]+5.48-input[2])/2.
"""


def register(app: typer.Typer) -> None:
    app.command("import", rich_help_panel="Files", epilog=EXAMPLE)(import_log)


@verb
def import_log(
    out: Output,
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...",
            help="A log: .csv, .txt, .mat, .npz, .parquet, .mcap, or a format that an installed "
            "package can read.",
        ),
    ],
    profile: LogProfile = None,
    output: OutputFile = None,
    mapping: Annotated[
        list[str] | None,
        typer.Option(
            "--map",
            metavar="COLUMN=EXPR",
            help="Compute a column of the recording from the log's columns, e.g. "
            "'v_front_V=(Vs-Vd)/2'. Repeatable.",
        ),
    ] = None,
    columns: Columns = None,
    rate: Annotated[
        float | None,
        typer.Option(
            "--rate",
            metavar="HZ",
            min=1.0,
            help="Reduce the log to this rate: drop rows, and average the voltages from each kept "
            "row to the next. The recording's loop.rate_hz becomes this rate.",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Convert another program's log to a recording: heli3dof import LOG --profile P -o REC."""
    from heli3dof.cli.info import info_table
    from heli3dof.cli.inputs import complete_import_command
    from heli3dof.errors import RecordingError, UsageError, quoted
    from heli3dof.recording.atomic_write import check_outputs
    from heli3dof.recording.info import summary
    from heli3dof.recording.logs.column_mapping import parse_mapping
    from heli3dof.recording.logs.import_log import is_log, read_log, recording_of
    from heli3dof.recording.logs.preview import preview
    from heli3dof.recording.write import write_recording

    given = parse_mapping(mapping or ())
    there = all(log.exists() for log in logs)  # if not, read_log reports the missing one
    named = " ".join(map(str, logs))
    if profile is None and there and any(map(is_log, logs)):
        raise UsageError(
            f"{named} is a log, and a log does not contain the profile of its rig.",
            cause="--profile is missing.",
            fix=f"heli3dof import {' '.join(map(quoted, logs))} --profile PROFILE.toml -o REC.mcap",
        )
    if there:
        check_outputs(output, force=force, inputs=logs)
    table = read_log(logs, rig_profile(profile), columns, given, rate)
    found = preview(table)
    out.show(*_lines(found))
    try:
        recording = recording_of(logs, table)
    except RecordingError as error:
        complete_import_command(error, logs, profile, output, given)
        raise
    about = summary(recording)
    out.warn(*about["warnings"])
    if output is not None:
        write_recording(recording, output, force=force)
        out.show(info_table(about))
    out.show(*_log_table(given, recording.profile, profile))
    if output is None:
        out.note(f"Nothing was written. To write the recording: -o {quoted(recording.name)}.mcap")
    else:
        out.note(f"Recording: {output}")
    file = None if output is None else str(output)
    out.emit({"schema": "heli3dof.info/1", "file": file, **about, "import": found})


def _log_table(given: Mapping[str, str], profile: Profile, file: Path | None) -> Iterator[str]:
    """Yield, line by line, the advice to add the ``--map`` expressions to the profile's ``[log]``.

    ``given``: column → expression from ``--map``. The advice lists each column for which ``[log]``
    of ``profile`` does not state the same expression. If there is no such column, the function
    yields nothing. ``file``: the profile's file, which the advice names.
    """
    from heli3dof.rig.profile_file import literal

    known = profile.log.expressions if profile.log is not None else {}
    lacking = {name: text for name, text in given.items() if known.get(name) != text}
    if lacking:
        place = f"{'[log] of ' if known else ''}{file or 'its profile'}"
        yield f"To use this mapping for every log of the rig, add to {place}:"
        yield from [] if known else ["[log]"]
        yield from (f"{name} = {literal(text)}" for name, text in lacking.items())


def _lines(found: Mapping[str, Any]) -> Iterator[Table | str]:
    """Yield a table of a log's columns, a sentence on its samples, and what the import ignores."""
    from rich.table import Table

    table = Table("column", "from", "unit")
    for column in table.columns[:2]:
        column.overflow = "fold"
    for name in ("first", "min", "max"):
        table.add_column(name, justify="right", no_wrap=True)
    for each in found["columns"]:
        table.add_row(*_row(each))
    if found["channels"]:
        table.add_section()
        for each in found["channels"]:
            table.add_row(*_row(each | {"source": "channel"}))
    yield table
    period, start = found["period_s"], found["start_s"]
    clock = "no time"
    if period is not None:
        clock = minus(f"from {start:g} s, every {period:.3g} s (median)")
    n = found["samples"]
    yield f"{found['source']}: {n} sample{'s' * (n != 1)}, {clock}"
    yield from found["notes"]
    for text in found["ignored"]:
        yield f"Ignored: {text}"


def _row(column: Mapping[str, Any]) -> list[str]:
    numbers = (
        "" if column[k] is None else minus(f"{column[k] + 0.0:.4g}")
        for k in ("first", "min", "max")
    )
    return [column["name"], column["source"], column["unit"], *numbers]
