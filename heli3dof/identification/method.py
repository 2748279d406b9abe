"""`Method`: the record that makes an identification method available as ``--method NAME``."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from heli3dof.identification.fit_result import FitResult, Request
    from heli3dof.identification.preprocessing import Prepared


@dataclass(frozen=True)
class Method:
    """An identification method: its name for ``--method``, a sentence for the help, and its fit."""

    name: str
    sentence: str
    function: str
    """The fit as ``module:function``, called with (`Prepared`, `Request`). Only `fit` imports it,
    because the command line loads every `Method` to list them."""
    assumes_open_loop: bool = False
    """True if feedback from the angles to the voltages biases the estimates."""
    physical: bool = False
    """True if the model consists of physical terms that the user can add or leave out. Such a
    method can also use recordings that lack an angle."""

    def fit(self, prepared: Prepared, request: Request) -> FitResult:
        module, _, function = self.function.partition(":")
        result: FitResult = getattr(importlib.import_module(module), function)(prepared, request)
        return result
