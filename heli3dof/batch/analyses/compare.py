"""``batch compare``: how well models predict each recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from heli3dof.batch.analyses.base import Analysis, Document, Job, Row
from heli3dof.model.base import Model


def run(job: Job) -> Document:
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


def columns(document: Document) -> Row:
    flight = document["flights"][0]
    row: Row = {"replayed": flight["loop"] == "replayed", "verdict": " ".join(document["verdict"])}
    for model in flight["models"]:
        for horizon, by_axis in model["prediction"]["rmse_deg"].items():
            for axis, error in by_axis.items():
                row[f"{model['name']}_rmse_{horizon}_{axis}_deg"] = error
    return row


ANALYSIS = Analysis("compare", run, columns)
