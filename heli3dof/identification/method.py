"""`Method`: what a method of identification registers."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from heli3dof.identification.fit_result import FitResult, Request
    from heli3dof.identification.preprocessing import Prepared


@dataclass(frozen=True)
class Method:
    """A name for ``--method``, a sentence about it, and the function that fits."""

    name: str
    sentence: str
    function: str
    """``module:function``, called with (`Prepared`, `Request`). It is imported only to fit, because
    the command line loads every method to list them."""
    assumes_open_loop: bool = False
    """Biased where the voltages respond to the angles."""
    physical: bool = False
    """Has terms to add and leave out, and can use recordings that lack an angle."""

    def fit(self, prepared: Prepared, request: Request) -> FitResult:
        module, _, function = self.function.partition(":")
        result: FitResult = getattr(importlib.import_module(module), function)(prepared, request)
        return result
