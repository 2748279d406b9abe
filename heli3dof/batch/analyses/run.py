"""``batch run``: flies an emulated rig once per task, and records the flight."""

from __future__ import annotations

from heli3dof.batch.analyses.base import Analysis, Document, Job, Row


def run(job: Job) -> Document:
    from heli3dof.experiment.fly import fly_plan
    from heli3dof.experiment.plan import plan_from_dict

    device, path = str(job.options["device"]), job.output("recordings", ".mcap")
    flight = fly_plan(
        plan_from_dict(job.options["plan"]), device=device, profile=job.profile, output=path
    )
    flight.raise_if_cut_short()
    return {
        "schema": "heli3dof.swept_flight/1",
        "recording": str(path),
        "device": device,
        "plan": job.options["plan"]["name"],
        "varied": dict(job.options["varied"]),
        "outcome": flight.outcome.ending,
        "duration_s": flight.recording.duration,
        "digest": flight.recording.digest,
    }


def columns(document: Document) -> Row:
    names = ("recording", "device", "plan", "outcome", "duration_s", "digest")
    return {**{name: document[name] for name in names}, **document["varied"]}


ANALYSIS = Analysis("run", run, columns)
