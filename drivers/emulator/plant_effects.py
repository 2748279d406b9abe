"""Calling effects from the compiled plant: each effect is a small compiled function.

An effect's function has the signature ``(s, body, par, mem, out) → None`` over float64 arrays
(`plant_layout` names their places). The plant knows it only by its address, so a new effect
compiles alone and the plant never has to be compiled again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Function = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray], None]


class Kernel:
    """A decorated effect function; compiled (and cached on disk) when first asked for."""

    def __init__(self, function: Function) -> None:
        self.function = function
        self._compiled: Any = None

    @property
    def address(self) -> int:
        """Where the machine code stands in this process."""
        if self._compiled is None:
            import numba

            array = numba.float64[::1]
            signature = numba.void(array, array, array, array, array)
            self._compiled = numba.cfunc(signature, cache=True, error_model="numpy")(self.function)
        return int(self._compiled.address)


kernel = Kernel
