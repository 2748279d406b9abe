"""`recover`: what a torn or damaged recording still holds, into a new file.

A chunk is written at once and carries its checksum, so what can be trusted is known: every
whole chunk whose checksum is right. A chunk cut in two is lost (its compressed bytes are one
block, which decodes whole or not at all): at most 0.15 s of a flight. The original is not
touched.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode

from heli3dof.errors import RecordingError
from heli3dof.recording.atomic_write import new_file
from heli3dof.recording.mcap_files.chunk import rows_of_chunk
from heli3dof.recording.mcap_files.mcap_scan import Damaged, Scan, decode_chunk
from heli3dof.recording.mcap_files.mcap_writer import OUTCOME, McapFile
from heli3dof.recording.mcap_files.reader import chunk_rows, found_names, open_mcap, our_layouts
from heli3dof.recording.mcap_files.schema import SAMPLE, RowFormat


@dataclass(frozen=True)
class Recovery:
    """What `recover` did."""

    path: Path
    """The new file."""
    samples: int
    seconds: float
    """From the first to the last sample that was brought back."""
    bytes_lost: int
    """Bytes behind the last whole record."""
    chunks_damaged: int
    """Whole chunks with a wrong checksum, left out."""


@dataclass(frozen=True, eq=False)
class Salvage:
    """The rows of every trustworthy chunk, in order, and how many chunks were not."""

    form: RowFormat
    rows: np.ndarray
    chunks_damaged: int


def recover(path: str | Path, output: str | Path | None = None, *, force: bool = False) -> Recovery:
    """Write what ``path`` still holds to ``output`` (``NAME.recovered.mcap`` beside it).

    The new file's outcome is ``recovered``, with the outcome the original had, if any, and what
    was lost. Raises RecordingError when there is nothing to mend or nothing to save.
    """
    path = Path(path)
    output = path.with_name(f"{path.stem}.recovered.mcap") if output is None else Path(output)
    found = open_mcap(path)
    saved = salvage(path, found)
    if found.whole and found.intact and not saved.chunks_damaged:
        raise RecordingError(
            f"{path} is whole; there is nothing to recover.",
            cause="another file is torn, or this one was recovered already.",
            fix=f"heli3dof info {path}",
        )
    if not len(saved.rows):
        raise RecordingError(
            f"{path} ends before its first samples; there is nothing to bring back.",
            cause="the program was killed in the first fraction of a second.",
            fix="fly again",
        )
    times = saved.rows[SAMPLE.name]["t_s"]
    result = Recovery(
        output,
        len(saved.rows),
        float(times[-1] - times[0]),
        0 if found.whole else len(found.data) - found.good,
        saved.chunks_damaged,
    )
    before = found.metadata.get(OUTCOME, {})
    outcome = {
        **{k: v for k, v in before.items() if k not in {"outcome", "rows"}},
        "outcome": "recovered",
        "outcome_before": before.get("outcome"),
        "bytes_lost": result.bytes_lost,
        "chunks_damaged": result.chunks_damaged,
        "recovered_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        "rows": result.samples,
    }
    with new_file(output, force=force) as stream:
        names = found_names(found)
        file = McapFile(stream, saved.form, {"Channels": names} if names else None)
        file.start({name: data for name, data in found.metadata.items() if name != OUTCOME})
        step = rows_of_chunk(saved.form)
        for i in range(0, len(saved.rows), step):
            file.write_chunk(saved.rows[i : i + step].tobytes())
        file.add_metadata(OUTCOME, outcome)
        file.finish()
    return result


def salvage(path: Path, found: Scan) -> Salvage:
    """Every row of ``found`` that can be trusted. Raises RecordingError for files not of ours."""
    try:
        layouts = our_layouts(found) if found.channels else None
    except Damaged as error:
        raise RecordingError(
            f"{path} is damaged where its columns are described: {error}.",
            cause="the disk or a copy over the network changed some bytes.",
            fix="copy it again from where it was recorded",
        ) from error
    if layouts is None:
        if found.channels or found.whole:
            raise RecordingError(
                f"{path} was written by another program; only heli3dof's recordings can be "
                "recovered here.",
                cause="its topics are not heli3dof's.",
                fix=f"mcap recover {path} -o {path.stem}.recovered.mcap (MCAP's own tool)",
            )
        raise RecordingError(
            f"{path} ends within its first {len(found.data)} bytes, before any sample.",
            cause="the program was killed as it began, or the copy was cut short.",
            fix="copy it again from where it was recorded, or fly again",
        )
    form = RowFormat(layouts)
    parts: list[np.ndarray] = []
    damaged = 0
    for content in found.of(Opcode.CHUNK):
        try:
            rows = chunk_rows(decode_chunk(content), form)
        except Damaged:
            rows = None
        if rows is None:
            damaged += 1
        else:
            parts.append(rows.view(np.uint8))
    whole = np.concatenate(parts).view(form.dtype) if parts else form.empty(0)
    return Salvage(form, whole, damaged)
