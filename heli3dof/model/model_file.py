"""Read and write model files: JSON, schema ``heli3dof.model/1`` (docs/reference/model-file.md).

`save_model` and `read_model` handle any `Model`. `heli3dof.paper.models.load_model` also accepts
the names of the paper's models.
"""

from __future__ import annotations

import importlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from heli3dof.errors import RecordingError, UsageError, did_you_mean, quoted
from heli3dof.file_kind import model_files, no_file
from heli3dof.json_values import jsonable
from heli3dof.model.base import Model
from heli3dof.recording.atomic_write import check_ending, write_file

SCHEMA = "heli3dof.model/1"
FORMS = {"greybox": "GreyBoxModel", "linear": "LinearModel"}
"""Form of a model file → its class, in ``heli3dof.model.FORM.model``, with ``from_dict``"""


def save_model(model: Model, path: str | Path, *, force: bool = False) -> Path:
    """Write the model's file atomically and return its path.

    Raises OutputExists if the file exists and ``force`` is not set, UsageError if the ending is not
    ``.json``, and UsageError or NoSpace if the file cannot be written.
    """
    check_ending(Path(path), ".json")
    return write_file(Path(path), model_bytes(model), force=force)


def model_bytes(model: Model) -> bytes:
    """Return the content of the model's file."""
    data = jsonable({"schema": SCHEMA, **model.to_dict()})
    text = json.dumps(data, indent=1, allow_nan=False, ensure_ascii=False) + "\n"
    return text.encode("utf-8", "backslashreplace")


def read_model(path: str | Path) -> Model:
    """Return the model in the file ``path``; raise RecordingError if the file is unusable."""
    path = Path(path)
    data = _read_json(path)
    schema = data.get("schema")
    if schema != SCHEMA:
        name, _, version = str(schema).partition("/")
        if name == SCHEMA.partition("/")[0]:
            raise _unusable(
                path,
                f"is version {version!r} of the model file; this heli3dof reads {SCHEMA!r}",
                "it was written by another version of heli3dof.",
                "pip install --upgrade heli3dof, or heli3dof identify again",
            )
        models = " ".join(map(quoted, model_files(data)))
        raise _unusable(
            path,
            "is not a model file: its 'schema' is "
            + (f"{schema!r}" if schema is not None else "missing")
            + f", not {SCHEMA!r}",
            "it is another JSON document, for instance the output of --json.",
            f"give its model file: {models}" if models
            else "give the .json that heli3dof identify wrote",
        )  # fmt: skip
    form = data.get("form")
    if form not in list(FORMS):  # it may be unhashable
        raise _unusable(
            path,
            f"holds a model of the unknown form {form!r}",
            f"a newer heli3dof wrote it, or a typing error; {did_you_mean(str(form), FORMS)}",
            "pip install --upgrade heli3dof",
        )
    form_class = getattr(importlib.import_module(f"heli3dof.model.{form}.model"), FORMS[form])
    try:
        model: Model = replace(form_class.from_dict(data), file=path)
    except KeyError as error:
        raise _unusable(
            path,
            f"lacks the key {error.args[0]!r}",
            "it was cut short or edited by hand.",
            "docs/reference/model-file.md lists the keys; heli3dof identify writes a complete one",
        ) from None
    except UsageError as error:
        raise RecordingError(
            f"{path} cannot be used here: {error.what}", cause=error.cause, fix=error.fix
        ) from error
    except (TypeError, ValueError) as error:
        raise _unusable(
            path,
            f"is inconsistent: {error}",
            "it was edited by hand.",
            "compare it with docs/reference/model-file.md, or write it with heli3dof identify",
        ) from None
    return model


def _read_json(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise no_file(path, "model file", RecordingError) from None
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        where = "" if isinstance(error, UnicodeDecodeError) else f" ({error})"
        raise _unusable(
            path,
            f"is not JSON{where}",
            "it is another kind of file (a recording?) or was cut short.",
            "give the .json that heli3dof identify wrote",
        ) from None
    except OSError as error:
        raise _unusable(
            path, f"cannot be read: {error.strerror}", "permissions.", f"ls -l {quoted(path)}"
        ) from error
    if not isinstance(data, dict):
        raise _unusable(
            path,
            "holds no JSON object",
            "it is another JSON document.",
            "give the .json that heli3dof identify wrote",
        )
    return data


def _unusable(path: Path, what: str, cause: str, fix: str) -> RecordingError:
    return RecordingError(f"{path} {what}.", cause=cause, fix=fix)
