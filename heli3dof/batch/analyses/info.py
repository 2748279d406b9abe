"""``batch info``: what each recording contains; of a torn (incomplete) one, its intact part."""

from __future__ import annotations

from heli3dof.batch.analyses.base import Analysis, Document, Job, Row, bad_data
from heli3dof.integrity import integrity
from heli3dof.recording.recording import Recording


def run(job: Job) -> Document:
    flight, about = job.intact
    faults = [f.to_dict() for f in integrity(flight)]
    return {"schema": "heli3dof.info/1", **about, "integrity": faults}


def columns(document: Document) -> Row:
    return {
        "faults": ";".join(bad_data(document["integrity"])),
        "torn": document["torn"],
        "bytes": document["bytes"],
        "samples": document["samples"],
        **{
            f"{axis}_{end}_deg": angle[f"{end}_deg"]
            for axis, angle in document["angles"].items()
            for end in ("min", "max")
        },
        "min_V": document["voltage"]["min_V"],
        "max_V": document["voltage"]["max_V"],
        "controller_is_known": document["loop_is_known"],
        "warnings": "; ".join(document["warnings"]),
    }


def intact_part(job: Job) -> Recording:
    return job.intact[0]


ANALYSIS = Analysis("info", run, columns, intact_part)
