"""The compiled functions of the effects, which the compiled plant calls by address.

An effect's function has the signature ``(s, body, par, mem, out) → None`` over float64 arrays.
``s`` contains time, angles, rates, voltages and thrusts; ``body`` the body's parameters; ``par``
and ``mem`` the effect's own parameters and memory; ``out`` the values that it changes.
`plant_layout` names their indices. The plant knows only the function's address, so a new effect is
compiled without compiling the plant again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Row = np.ndarray
"""(n,) float64, C-contiguous"""
Function = Callable[[Row, Row, Row, Row, Row], None]


class Kernel:
    """Decorator that compiles an effect's function at its first use and caches it on disk."""

    def __init__(self, function: Function) -> None:
        self.function = function
        self._compiled: Any = None

    @property
    def address(self) -> int:
        """Return the memory address of the effect's function, which is compiled if necessary."""
        if self._compiled is None:
            import numba

            array = numba.float64[::1]
            signature = numba.void(array, array, array, array, array)
            self._compiled = numba.cfunc(signature, cache=True, error_model="numpy")(self.function)
        return int(self._compiled.address)


kernel = Kernel
