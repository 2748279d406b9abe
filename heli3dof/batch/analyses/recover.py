"""``batch recover``: the intact part of each torn (incomplete) recording, as a new file."""

from __future__ import annotations

from heli3dof.batch.analyses.base import Analysis, Document, Job, Row
from heli3dof.batch.analyses.info import intact_part
from heli3dof.recording.mcap_files.recover import recover


def run(job: Job) -> Document:
    if not job.intact[1]["torn"]:
        return {"schema": "heli3dof.recovery/1", "file": None, "torn": False}
    saved = recover(job.file, job.output("recordings", ".mcap"))
    return {"schema": "heli3dof.recovery/1", "torn": True, **saved.document()}


def columns(document: Document) -> Row:
    names = ("torn", "file", "samples", "bytes_lost", "chunks_damaged")
    return {name: document.get(name) for name in names}


ANALYSIS = Analysis("recover", run, columns, intact_part)
