"""The interface of all identification methods: a method gets a `Request`, returns a `FitResult`.

All methods share preprocessing, validation, residual tests, JSON and printing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from heli3dof.identification.preprocessing import Prepared
from heli3dof.identification.transfer_function import TransferFunctions
from heli3dof.model.base import Model
from heli3dof.model.estimation.filter_data import Run
from heli3dof.recording.recording import Recording

Innovations = tuple[list[np.ndarray], list[np.ndarray]]
"""Two lists over segments: errors e (N, 3) rad, and the voltages u (N, 2) V at the same rows."""


@dataclass(frozen=True)
class Request:
    """The user's options for a fit: method, order, sampling intervals, terms, the model's name."""

    method: str
    order: int | None
    """Number of states of a black box; None: the order search chooses it."""
    intervals_s: tuple[float, ...]
    """s: the sampling intervals that the order search tries."""
    name: str
    terms: tuple[str, ...] | None = None
    """Effects of a physical model by name; None: the method's default."""
    partial: tuple[Recording, ...] = ()
    """Recordings that lack an angle, for methods that can use them."""


@dataclass(frozen=True)
class Parameter:
    """An estimated physical parameter: ``value``, standard deviation ``std`` (NaN if unknown)."""

    value: float
    std: float
    unit: str
    bound: float = np.nan
    """The Cramér–Rao bound on ``std``; NaN where the method has none."""
    nominal: float = np.nan
    """The profile's value; NaN where it has none."""
    verdict: str = ""
    """Why the value is unreliable; empty otherwise."""


@dataclass(frozen=True)
class Pole:
    """A continuous-time pole (1/s) with standard deviations of real and imaginary part, or NaN."""

    value: complex
    std_real: float
    std_imag: float

    def to_json(self) -> dict[str, float]:
        return {
            "re_per_s": self.value.real,
            "im_per_s": self.value.imag,
            "re_std_per_s": self.std_real,
            "im_std_per_s": self.std_imag,
        }


def rightmost_first(poles: Sequence[Pole]) -> tuple[Pole, ...]:
    """Return the poles sorted by falling real part."""
    return tuple(sorted(poles, key=lambda p: (-p.value.real, p.value.imag)))


@dataclass(frozen=True, eq=False)
class Candidate:
    """A fit that the order search tried. ``score``: mean fit (%), by which the search chooses."""

    order: int
    interval_s: float
    score: float
    log_likelihood: float
    bic: float
    problem: str
    """Why the fit cannot be used, or empty."""

    def to_json(self) -> dict[str, Any]:
        return {
            "order": self.order,
            "interval_s": self.interval_s,
            "score_percent": self.score,
            "log_likelihood": self.log_likelihood,
            "bic": self.bic,
            "problem": self.problem,
        }


@dataclass(frozen=True, eq=False)
class FitResult:
    """The result of an identification method: a fitted model with its uncertainty."""

    model: Model
    """At the control rate."""
    order: int
    interval_s: float
    """s between the samples of the fit."""
    innovations: Callable[[Prepared, Sequence[Run]], Innovations]
    """Function (prepared, runs) → prediction errors: one step ahead, or of the simulation if the
    method is output error."""
    poles: tuple[Pole, ...] = ()
    transfer: TransferFunctions | None = None
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    candidates: tuple[Candidate, ...] = ()
    warnings: tuple[str, ...] = ()
    response: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]] | None = None
    """ω (F,) rad/s → G (F, 3, 2) and its standard deviation, rad/V."""
    test_interval_s: float | None = None
    """s between the errors of ``innovations``; None: ``interval_s``."""
    correlation: np.ndarray | None = None
    """(n, n) correlation matrix of the ``parameters``, in their order."""
    method: str = ""
    """Name of the method that fitted; empty if it is the requested one."""
