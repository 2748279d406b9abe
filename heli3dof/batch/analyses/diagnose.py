"""``batch diagnose``: the causes of each recording's simulation error.

The column ``causes`` lists the causes, strongest first; after ``|`` follow the effects that a cause
is confounded with, as in ``friction.coulomb.yaw|friction.viscous.yaw; motor.lag``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from heli3dof.axes import AXES
from heli3dof.batch.analyses.base import Analysis, Document, Job, Row, bad_data, with_std
from heli3dof.batch.bootstrap import block_replicate
from heli3dof.diagnosis import name_of


def run(job: Job) -> Document:
    from heli3dof.diagnosis.diagnose import diagnose
    from heli3dof.diagnosis.document import diagnosis_document
    from heli3dof.model.model_file import save_model

    quick, seed = bool(job.options["quick"]), int(job.options["seed"])
    replicate = int(job.options["replicate"])
    result = diagnose(block_replicate(job.recording, replicate, seed), quick=quick, seed=seed)
    path = None
    if result.fitted is not None:
        path = str(save_model(result.fitted.model, job.output("models", ".json")))
    document = diagnosis_document(result, path)
    document["about"].pop("seconds", None)  # they differ from run to run
    return {**document, "replicate": replicate}


def columns(document: Document) -> Row:
    findings = document["findings"]
    first: Mapping[str, Any] = findings[0] if findings else {}
    row: Row = {
        "replicate": document["replicate"],
        "faults": ";".join(bad_data(document["integrity"])),
        "verdict": document["verdict"],
        "causes": "; ".join("|".join((name_of(f), *f["tied_with"])) for f in findings),
        "first_cause": name_of(first) if first else None,
        "confidence": first.get("confidence"),
        "model": document["model"],
        **{
            f"{axis}_{key}": document["simulation_error"][axis][key]
            for axis in AXES for key in ("rmse_deg", "noise_floor_deg")
        },
        **_gains(document["gain"]["holdout_rmse_deg"]),
        **{r["ratio"]: r["value"] for r in document["ratios"]},
        **{f"{r['ratio']}_std": r["std"] for r in document["ratios"]},
        **with_std({c["parameter"]: c for c in document["calibration"]}),
    }  # fmt: skip
    for f in findings:
        row |= with_std({f"{name_of(f)}.{name}": p for name, p in f["parameters"].items()})
    return row


def _gains(errors: Mapping[str, Mapping[str, float | None]]) -> Row:
    return {
        f"{axis}_holdout_rmse_{when}_deg": errors.get(when, {}).get(axis)
        for axis in AXES
        for when in ("before", "after")
    }


ANALYSIS = Analysis("diagnose", run, columns)
