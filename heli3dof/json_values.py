"""`jsonable`: converts results to the values that JSON has."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any


def jsonable(value: Any) -> Any:
    """Return ``value`` as JSON data: arrays as lists, complex as [re, im], NaN and ∞ as None.

    An object of any other type becomes its text.
    """
    if isinstance(value, Mapping):
        return {str(k): jsonable(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [jsonable(v) for v in value]
    if hasattr(value, "tolist"):  # arrays and numbers of numpy
        return jsonable(value.tolist())
    if isinstance(value, complex):
        return [jsonable(value.real), jsonable(value.imag)]
    if isinstance(value, float):
        return value if isfinite(value) else None
    return value if value is None or isinstance(value, (str, int)) else str(value)
