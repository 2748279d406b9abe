"""`Method`: what a method of identification registers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from heli3dof.identification.fit_result import FitResult, Request
    from heli3dof.identification.preprocessing import Prepared


@dataclass(frozen=True)
class Method:
    """A name for ``--method``, a sentence about it, and the function that fits.

    Import libraries inside ``fit``: the command line loads every method to list them.
    """

    name: str
    sentence: str
    fit: Callable[[Prepared, Request], FitResult]
    assumes_open_loop: bool = False
    """Biased where the voltages respond to the angles."""
    physical: bool = False
    """Has terms to add and leave out, and can use recordings that lack an angle."""
