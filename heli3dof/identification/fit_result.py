"""What every method hands back, whatever it fitted: the contract between a method and `identify`.

A method is one module with a function ``fit(prepared, request) -> Found`` and a line in
`heli3dof.identification.methods`. Preparation, validation, residual tests, JSON and printing are
shared.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from heli3dof.identification.black_box.order_selection import Candidate
from heli3dof.identification.preprocessing import Prepared, Run
from heli3dof.identification.transfer_function import TransferFunctions
from heli3dof.identification.uncertainty import Pole
from heli3dof.model.base import Model
from heli3dof.recording.recording import Recording


@dataclass(frozen=True)
class Request:
    """What the user asked for: the method's name, the order (None: choose), intervals (s)."""

    method: str
    order: int | None
    intervals_s: tuple[float, ...]
    name: str
    terms: tuple[str, ...] | None = None
    """Effects of a physical model by name; None: what the method takes by itself."""
    partial: tuple[Recording, ...] = ()
    """Recordings that lack an angle, for methods that can use them."""


@dataclass(frozen=True)
class Parameter:
    """A physical parameter with its standard deviation (NaN where unknown) and unit."""

    value: float
    std: float
    unit: str
    bound: float = np.nan
    """The Cramér–Rao bound on ``std``; NaN where the method knows none."""
    nominal: float = np.nan
    """What the profile says; NaN where it says nothing."""
    verdict: str = ""
    """Why it should not be relied on; empty where it may be."""


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
    test_interval_s: float | None = None
    """s between the errors that ``innovations`` gives, where that is not ``interval_s``."""
    correlation: np.ndarray | None = None
    """(n, n) between the ``parameters``, in their order."""
    method: str = ""
    """The method that it was handed over to; empty where it was fitted by the one asked for."""
