"""The form ``linear``: `LinearModel`, whatever its kind (hover, statespace, tf4, oe, paper17 …)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from heli3dof.model.linear.model import LinearModel

_KEYS_SHAPES = {"A": "nn", "B": "n2", "C": "3n", "K": "n3", "S": "33", "u0_V": "2", "y0_rad": "3"}


def to_dict(model: LinearModel) -> dict[str, Any]:
    """Plain JSON-able content: lists of rows, numbers, null for NaN."""
    return {
        "form": "linear",
        "name": model.name,
        "kind": model.kind,
        "dt_s": model.dt,
        "order": model.order,
        "exact_hold": model.exact_hold,
        "A": _lists(model.A),
        "B": _lists(model.B),
        "C": _lists(model.C),
        "K": _lists(model.K),
        "S": _lists(model.S),
        "u0_V": _lists(model.u0),
        "y0_rad": _lists(model.y0),
        "extra": dict(model.extra),
    }


def from_dict(data: Mapping[str, Any]) -> LinearModel:
    """Back from `to_dict`. Raises KeyError (missing), TypeError or ValueError (does not fit)."""
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
    u0, y0 = arrays.pop("u0_V"), arrays.pop("y0_rad")
    return LinearModel(
        name=str(data["name"]),
        kind=str(data["kind"]),
        dt=dt,
        u0=u0,
        y0=y0,
        extra=dict(data.get("extra", {})),
        exact_hold=bool(data.get("exact_hold", False)),
        **arrays,
    )


def _lists(a: np.ndarray) -> Any:
    if a.ndim > 1:
        return [_lists(row) for row in a]
    return [float(x) if np.isfinite(x) else None for x in a]
