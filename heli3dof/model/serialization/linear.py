"""Read model files of the form ``linear`` (hover model, black boxes) into a `LinearModel`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from heli3dof.model.linear.model import LinearModel

_KEYS_SHAPES = {"A": "nn", "B": "n2", "C": "3n", "K": "n3", "S": "33", "u0_V": "2", "y0_rad": "3"}


def from_dict(data: Mapping[str, Any]) -> LinearModel:
    """Return the model from the output of `LinearModel.to_dict`.

    Raises KeyError for a missing key, TypeError or ValueError for invalid content.
    """
    n = len(data["A"])
    sizes = {"n": n, "2": 2, "3": 3}
    arrays = {}
    for key, letters in _KEYS_SHAPES.items():
        shape = tuple(sizes[s] for s in letters)
        array = np.array(data[key], dtype=float)
        if array.shape != shape:
            raise ValueError(f"{key} has the shape {array.shape}, not {shape}")
        if key not in {"C", "S"} and not np.isfinite(array).all():
            raise ValueError(f"{key} holds null where a number belongs")
        arrays[key] = array
    dt = float(data["dt_s"])
    if not 0 < dt < np.inf:
        raise ValueError(f"dt_s is {dt}, not a positive number of seconds")
    return LinearModel(
        name=str(data["name"]),
        kind=str(data["kind"]),
        dt=dt,
        u0=arrays.pop("u0_V"),
        y0=arrays.pop("y0_rad"),
        extra=dict(data.get("extra", {})),
        exact_hold=bool(data.get("exact_hold", False)),
        **arrays,
    )
