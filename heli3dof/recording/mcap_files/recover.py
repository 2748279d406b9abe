"""`recover`: writes the intact part of an incomplete or damaged recording to a new file.

Every complete chunk with a correct checksum is kept, also after unreadable bytes. An incomplete
chunk, about 0.15 s of a flight, is lost: its compressed bytes decode as a whole or not at all. The
original file is not changed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.errors import RecordingError, quoted
from heli3dof.recording.atomic_write import check_ending, check_outputs, new_file
from heli3dof.recording.logs.log_validation import timing
from heli3dof.recording.mcap_files.mcap_scan import Damaged, Scan, our_format
from heli3dof.recording.mcap_files.mcap_writer import OUTCOME, write_rows
from heli3dof.recording.mcap_files.reader import intact_rows, open_mcap
from heli3dof.recording.mcap_files.schema import SAMPLE, RowFormat


@dataclass(frozen=True)
class Recovery:
    """Result of `recover`: the new file, its samples, and the losses from the original file."""

    path: Path
    """The new file"""
    samples: int
    """Number of recovered samples"""
    seconds: float
    """Time in s from the first to the last recovered sample"""
    bytes_lost: int
    """Number of bytes that belong to no record, between records or after the last; they are lost"""
    chunks_damaged: int
    """Number of complete chunks that could not be decoded; they are omitted"""
    warnings: list[str]
    """What is missing from the flight, as `loss_warnings` returns it"""

    def document(self) -> dict[str, Any]:
        """Return the result as a dict with the keys of ``recover --json``, except ``schema``."""
        return {
            "file": str(self.path),
            "samples": self.samples,
            "duration_s": self.seconds,
            "bytes_lost": self.bytes_lost,
            "chunks_damaged": self.chunks_damaged,
            "warnings": self.warnings,
        }


def recover(path: str | Path, output: str | Path | None = None, *, force: bool = False) -> Recovery:
    """Write the intact samples of ``path`` to ``output`` (default ``NAME.recovered.mcap``).

    The new file states the outcome ``recovered``, the losses, and the original outcome, if any.
    ``force`` replaces an existing file. Raises RecordingError if ``path`` is intact or has no
    intact samples, UsageError if ``output`` is ``path`` or cannot be written.
    """
    path = Path(path)
    output = path.with_name(f"{path.stem}.recovered.mcap") if output is None else Path(output)
    found = open_mcap(path)
    form, rows, chunks_damaged = salvage(path, found)
    if found.whole and found.intact and not chunks_damaged:
        raise RecordingError(
            f"{path} is intact; there is nothing to recover.",
            cause="you meant another file, or this one was recovered already.",
            fix=f"heli3dof info {quoted(path)}",
        )
    if not len(rows):
        raise RecordingError(
            f"{path} ends before its first sample; there is nothing to recover.",
            cause="the program was killed in the first fraction of a second.",
            fix="repeat the experiment",
        )
    check_outputs(output, force=force, inputs=[path])
    check_ending(output, ".mcap")
    times = rows[SAMPLE.name]["t_s"]
    seconds = float(times[-1] - times[0])
    lost = losses(found, chunks_damaged)
    warnings = loss_warnings(times, lost)
    result = Recovery(output, len(rows), seconds, found.bytes_lost, chunks_damaged, warnings)
    before = found.metadata.get(OUTCOME, {})
    outcome = {
        **{k: v for k, v in before.items() if k not in {"outcome", "rows"}},
        "outcome": "recovered",
        "outcome_before": before.get("outcome"),
        **lost,
        "recovered_utc": datetime.now(UTC).isoformat(timespec="seconds"),
        "rows": result.samples,
    }
    with new_file(output, force=force) as stream:
        write_rows(stream, form, rows, {**found.metadata, OUTCOME: outcome})
    return result


def losses(found: Scan, chunks_damaged: int) -> dict[str, Any]:
    """Return what a damaged file has lost, with the keys of a recovered recording's outcome."""
    return {
        "bytes_lost": found.bytes_lost,
        "chunks_damaged": chunks_damaged,
        "end_missing": OUTCOME not in found.metadata,
    }


def loss_warnings(t: np.ndarray, details: Mapping[str, Any]) -> list[str]:
    """Return warnings of the samples that a damaged file or a full disk has lost.

    ``t`` (N,): times in s of the samples that are left. ``details``: the recording's
    ``meta["outcome_details"]``; without `losses` in it, gaps in time count as losses of the line.
    """
    found = []
    if details.get("end_missing") or details.get("rows_lost"):
        found.append(
            f"the recording's end is missing: it stops at {t[-1]:.2f} s. Likely cause: the program "
            "was killed, the disk was full, or the copy is incomplete."
        )
    if "chunks_damaged" in details and len(t) > 1 and (np.diff(t) > 0).all():
        seen = timing(t)
        if seen.gaps:
            missing = round(len(t) * seen.lost_share / (1 - seen.lost_share))
            found.append(
                f"{missing} samples are missing in {seen.gaps} gap{'s' * (seen.gaps != 1)}, the "
                f"longest of {seen.longest_gap_s:.3g} s. Likely cause: damaged bytes in the file."
            )
    return found


def salvage(path: Path, found: Scan) -> tuple[RowFormat, np.ndarray, int]:
    """Return the byte format and the rows of a file's intact chunks; the number of damaged chunks.

    ``found``: the file's records. Raises RecordingError for another program's file, and for missing
    or damaged schemas.
    """
    try:
        form = our_format(found) if found.channels else None
    except Damaged as error:
        raise RecordingError(
            f"{path}: the description of its columns is damaged: {error}.",
            cause="the disk or a network copy changed some bytes.",
            fix="copy the original file again",
        ) from error
    if form is None:
        if found.channels or found.whole:
            raise RecordingError(
                f"{path} was written by another program; only heli3dof's recordings can be "
                "recovered.",
                cause="its topics are not heli3dof's.",
                fix=f"mcap recover {quoted(path)} -o {quoted(path.stem)}.recovered.mcap "
                "(MCAP's own tool)",
            )
        raise RecordingError(
            f"{path} ends within its first {len(found.data)} bytes, before any sample.",
            cause="the program was killed at its start, or the copy is incomplete.",
            fix="copy the original file again, or repeat the experiment",
        )
    return form, *intact_rows(found, form)
