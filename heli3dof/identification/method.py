"""`Method`: the class that makes an identification method available as ``--method NAME``."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from heli3dof.errors import UsageError

if TYPE_CHECKING:
    from heli3dof.identification.fit_result import FitResult, Request
    from heli3dof.identification.preprocessing import Prepared


@dataclass(frozen=True)
class Method:
    """An identification method: its name for ``--method``, a sentence for the help, and its fit."""

    name: str
    sentence: str
    function: str
    """The fit as ``module:function``, called with (`Prepared`, `Request`); it returns a `FitResult`
    (`heli3dof.identification.preprocessing`, `heli3dof.identification.fit_result`). Only `fit`
    imports it, because the command line loads every `Method` to list them."""
    assumes_open_loop: bool = False
    """True if feedback from the angles to the voltages biases the estimates."""
    physical: bool = False
    """True if the model consists of physical effects that the user can add or leave out. Such a
    method can also use recordings that lack an angle."""

    def fit(self, prepared: Prepared, request: Request) -> FitResult:
        """Import the method's function, call it with ``prepared`` and ``request``, return its fit.

        Raises UsageError if the function is missing or returns no `FitResult`.
        """
        from heli3dof.identification.fit_result import FitResult

        module, _, name = self.function.partition(":")
        try:
            function = getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError) as error:
            raise UsageError(
                f"The method {self.name} cannot be imported from {self.function}: {error}.",
                cause="the text module:function in its METHOD is mistyped, or a library is not "
                "installed.",
                fix=f'python -c "import {module}"',
            ) from error
        result = function(prepared, request)
        if not isinstance(result, FitResult):
            raise UsageError(
                f"The method {self.name} returned a {type(result).__name__}; "
                "a method returns a FitResult.",
                cause=f"its function, {self.function}, is incomplete.",
                fix="read heli3dof/identification/fit_result.py, or use --method greybox",
            )
        return result
