"""What every method hands back, whatever it fitted: the contract between a method and `identify`.

A method is one module with a function ``fit(prepared, request) -> Found`` and a line in
`heli3dof.identification.methods`. Preparation, validation, residual tests, JSON and printing are
shared.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from heli3dof.identification.prepare import Prepared, Run
from heli3dof.identification.search import Candidate
from heli3dof.identification.statistics import Pole
from heli3dof.identification.transfer import TransferFunctions
from heli3dof.model.base import Model


@dataclass(frozen=True)
class Request:
    """What the user asked for: the method's name, the order (None: choose), intervals (s)."""

    method: str
    order: int | None
    intervals_s: tuple[float, ...]
    name: str


@dataclass(frozen=True)
class Parameter:
    """A physical parameter with its standard deviation (NaN where unknown) and unit."""

    value: float
    std: float
    unit: str


Innovations = tuple[list[np.ndarray], list[np.ndarray]]
"""Per segment: errors e (N, 3) rad, and the voltages u (N, 2) V that went with them."""


@dataclass(frozen=True, eq=False)
class Found:
    """A fitted model and what its method knows about it."""

    model: Model
    """At the control rate."""
    order: int
    interval_s: float
    """s between the samples that it was fitted to."""
    innovations: Callable[[Prepared, Sequence[Run]], Innovations]
    """Errors over runs at ``interval_s``: one step ahead, or of the simulation (output error)."""
    poles: tuple[Pole, ...] = ()
    transfer: TransferFunctions | None = None
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    candidates: tuple[Candidate, ...] = ()
    warnings: tuple[str, ...] = ()
    response: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]] | None = None
    """ω (F,) rad/s → G (F, 3, 2) and its standard deviation, rad/V."""
