"""The verbs (subcommands) that ``heli3dof batch`` can run, and their table columns."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from heli3dof.axes import AXES
from heli3dof.batch.bootstrap import block_replicate
from heli3dof.batch.task import Task
from heli3dof.batch.thrust_columns import thrust_columns
from heli3dof.diagnosis import name_of
from heli3dof.integrity import Kind, integrity
from heli3dof.model.base import Model
from heli3dof.recording.info import read_with_info
from heli3dof.recording.load import load
from heli3dof.recording.mcap_files.recover import recover
from heli3dof.recording.recording import Recording

FITS = ("one_step", "0.5_s", "1_s")
"""Prediction horizons for which the results table has columns with the fit"""
Document = Mapping[str, Any]
Row = dict[str, Any]


@dataclass(frozen=True)
class Job:
    """The arguments with which a worker runs a verb (subcommand) on one recording."""

    task: Task
    path: Path | None
    """The recording's file on the worker's machine; None in a sweep"""
    folder: Path
    """Folder in which the verb writes; its files are then moved to the output folder"""

    @property
    def options(self) -> Mapping[str, Any]:
        return self.task.options

    @cached_property
    def recording(self) -> Recording:
        """Return the job's recording. Raises RecordingError or UsageError if it is unreadable."""
        return load(self.file, self.task.profile)

    @cached_property
    def intact(self) -> tuple[Recording, dict[str, Any]]:
        """Return the job's recording, and a dict of what `heli3dof info` states about it.

        Of an incomplete file, the recording contains the intact part only.
        """
        return read_with_info(self.file, self.task.profile)

    @property
    def file(self) -> Path:
        """Return the recording's file."""
        assert self.path is not None
        return self.path

    def output(self, kind: str, ending: str) -> Path:
        """Return the path of an output file of the job; create its folder.

        The folder is called ``kind``, the file has the task's label and this ``ending``.
        """
        path = self.folder / kind / f"{self.task.label}{ending}"
        path.parent.mkdir(parents=True, exist_ok=True)
        return path


@dataclass(frozen=True)
class Analysis:
    """A verb (subcommand) that a batch runs on each recording: its function and table columns."""

    run: Callable[[Job], Document]
    """Function (job) → the verb's JSON document. It may raise Heli3dofError."""
    columns: Callable[[Document], Row]
    """Function (JSON document) → the verb's columns of the results table"""
    accepts_torn: bool = False
    """True if the verb uses the intact part of a torn recording"""


def _compare(job: Job) -> Document:
    from heli3dof.comparison.compare import compare
    from heli3dof.comparison.document import comparison_document

    return comparison_document(compare([job.recording], _models(job)))


def model_texts(names: Sequence[str]) -> dict[str, str | None]:
    """Return model name → content of the model file, None for a built-in model.

    A job gets the result as its option ``models``. Raises UsageError or RecordingError for a model
    that cannot be loaded.
    """
    from heli3dof.paper.models import BUILT_IN, load_model

    for name in names:
        load_model(name)
    return {n: None if n in BUILT_IN else Path(n).read_text(encoding="utf-8") for n in names}


def _models(job: Job) -> list[Model]:
    """Return the models of the job's option ``models``, which `model_texts` describes."""
    from heli3dof.paper.models import load_model

    models: list[Model] = []
    for name, text in job.options["models"].items():
        if text is None:
            models.append(load_model(name, job.recording.profile))
            continue
        path = job.folder.parent / Path(name).name
        path.write_text(text, encoding="utf-8")
        models.append(load_model(str(path), job.recording.profile))
    return models


def _compare_columns(document: Document) -> Row:
    flight = document["flights"][0]
    row: Row = {"replayed": flight["loop"] == "replayed", "verdict": " ".join(document["verdict"])}
    for model in (m for m in flight["models"] if m["prediction"]):
        for horizon, by_axis in model["prediction"]["rmse_deg"].items():
            for axis, error in by_axis.items():
                row[f"{model['name']}_rmse_{horizon}_{axis}_deg"] = error
    return row


def _diagnose(job: Job) -> Document:
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


def _diagnose_columns(document: Document) -> Row:
    """Return the columns of a diagnosis.

    The column ``causes`` lists the causes, strongest first, as in
    ``friction.coulomb.yaw|friction.viscous.yaw; motor.lag``. The effects after ``|`` are confounded
    with the cause before it.
    """
    findings = document["findings"]
    first: Mapping[str, Any] = findings[0] if findings else {}
    errors = document["gain"]["holdout_rmse_deg"]
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
        **{
            f"{axis}_holdout_rmse_{when}_deg": errors.get(when, {}).get(axis)
            for axis in AXES for when in ("before", "after")
        },
        **{r["ratio"]: r["value"] for r in document["ratios"]},
        **{f"{r['ratio']}_std": r["std"] for r in document["ratios"]},
        **with_std({c["parameter"]: c for c in document["calibration"]}),
    }  # fmt: skip
    for f in findings:
        row |= with_std({f"{name_of(f)}.{name}": p for name, p in f["parameters"].items()})
    return row


def _identify(job: Job) -> Document:
    """Identify and save a model; return its ``identify --json`` document, with four more keys.

    * ``faults`` names the integrity checks that found bad data. Such a recording is not fitted:
      ``models`` is empty, and ``fleet`` leaves the recording out.
    * ``absent`` names the parameters at the bound that means "no effect".
    * ``nominal_hover_voltage_V`` is the hover voltage in the profile.
    * ``hover_voltage_V`` has the ``value`` and ``std`` of the identified model's hover voltage. It
      is null for a black-box model, or if no voltage holds the arm level.

    If there are faults, the document has only the first of these keys.
    """
    from heli3dof.identification.identify import identify
    from heli3dof.model.model_file import save_model

    faults = bad_data(f.to_dict() for f in integrity(job.recording))
    if faults:
        return {"schema": "heli3dof.identification/1", "models": [], "faults": faults}
    result = identify(
        job.recording,
        method=job.options.get("method", "greybox"),
        order=job.options.get("order"),
        terms=job.options.get("terms"),
    )
    path = save_model(result.model, job.output("models", ".json"))
    return {
        "schema": "heli3dof.identification/1",
        "models": [result.to_dict(str(path))],
        "faults": faults,
        "absent": [n for n, p in result.found.parameters.items() if p.absent],
        "nominal_hover_voltage_V": job.recording.profile.motor.V_o,
        "hover_voltage_V": _hover_voltage(result.model),
    }


def _hover_voltage(model: Model) -> dict[str, float] | None:
    from heli3dof.model.greybox.linearisation import level_hover
    from heli3dof.model.greybox.model import GreyBoxModel

    hover = level_hover(model) if isinstance(model, GreyBoxModel) else None
    return None if hover is None else {"value": hover.voltage_V, "std": hover.std_V}


def _identify_columns(document: Document) -> Row:
    """Return the columns of an identification.

    An ``absent`` parameter has the value at which its effect vanishes, and its standard deviation.
    """
    if not document["models"]:
        return {"faults": ";".join(document["faults"])}
    model = document["models"][0]
    parameters = model.get("parameters", {})
    estimated = {
        n: {**p, "value": p["nominal"]} if n in document["absent"] else p
        for n, p in parameters.items()
    }
    fits = {
        f"fit_{horizon}_{axis}_percent": fit.get(horizon)
        for axis, fit in (model["fit_percent"] or {}).items()
        for horizon in FITS
    }
    return {
        "faults": ";".join(document["faults"]),
        "absent": ";".join(document["absent"]),
        "model": model["file"],
        "method": model["method"],
        "order": model["order"],
        "warnings": len(model["warnings"]),
        **thrust_columns(parameters, model.get("correlation"), document.get("hover_voltage_V")),
        **with_std(estimated),
        **fits,
    }


def _info(job: Job) -> Document:
    flight, about = job.intact
    faults = [f.to_dict() for f in integrity(flight)]
    return {"schema": "heli3dof.info/1", **about, "integrity": faults}


def _info_columns(document: Document) -> Row:
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


def _recover(job: Job) -> Document:
    if not job.intact[1]["torn"]:
        return {"schema": "heli3dof.recovery/1", "file": None, "torn": False}
    saved = recover(job.file, job.output("recordings", ".mcap"))
    return {"schema": "heli3dof.recovery/1", "torn": True, **saved.document()}


def _recover_columns(document: Document) -> Row:
    names = ("torn", "file", "samples", "bytes_lost", "chunks_damaged")
    return {name: document.get(name) for name in names}


def _run(job: Job) -> Document:
    from heli3dof.experiment.fly import fly_plan
    from heli3dof.experiment.plan import plan_from_dict

    device, path = str(job.options["device"]), job.output("recordings", ".mcap")
    flight = fly_plan(
        plan_from_dict(job.options["plan"]), device=device, profile=job.task.profile, output=path
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


def _run_columns(document: Document) -> Row:
    names = ("recording", "device", "plan", "outcome", "duration_s", "digest")
    return {**{name: document[name] for name in names}, **document["varied"]}


def bad_data(integrity: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return the names of the checks that found bad data; ``integrity``: a recording's faults."""
    return [f["check"] for f in integrity if f["kind"] == Kind.BAD_DATA]


def with_std(parameters: Mapping[str, Mapping[str, Any]]) -> Row:
    """Return two columns for each parameter: its value, and its standard deviation ``NAME_std``."""
    row: Row = {}
    for name, p in parameters.items():
        row[name], row[f"{name}_std"] = p["value"], p["std"]
    return row


ANALYSES = {
    "compare": Analysis(_compare, _compare_columns),
    "diagnose": Analysis(_diagnose, _diagnose_columns),
    "identify": Analysis(_identify, _identify_columns),
    "info": Analysis(_info, _info_columns, accepts_torn=True),
    "recover": Analysis(_recover, _recover_columns, accepts_torn=True),
    "run": Analysis(_run, _run_columns),
}
"""Name of the verb → what the batch runs"""
