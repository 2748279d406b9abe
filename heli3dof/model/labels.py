"""Label models in tables, figures and documents, so that each has a label of its own."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from pathlib import Path

from heli3dof.model.base import Model


def labels(models: Sequence[Model]) -> list[str]:
    """Return a distinct label for each model.

    The label is the model's name if no other model has it, else the stem of the model's file. If
    there is no file, or the stem is not distinct, the label is the name. From its second use on,
    such a name gets a number: ``extended (2)``.
    """
    names = [m.name for m in models]
    files: list[Path | None] = [getattr(m, "file", None) for m in models]
    first = [
        file.stem if file and names.count(name) > 1 else name
        for name, file in zip(names, files, strict=True)
    ]
    out: list[str] = []
    for name, label in zip(names, first, strict=True):
        choice = label if first.count(label) == 1 else name
        for k in count(2):
            if choice not in out:
                break
            choice = f"{name} ({k})"
        out.append(choice)
    return out
