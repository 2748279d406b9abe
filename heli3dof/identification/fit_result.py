"""The interface of all identification methods: they get a `Request` and return a `FitResult`.

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
from heli3dof.model.estimation.filter_data import RowRange
from heli3dof.recording.recording import Recording

Innovations = tuple[list[np.ndarray], list[np.ndarray]]
"""Two lists, each with an array per run of usable rows: prediction errors (N, 3) rad, and voltages
(N, 2) V at the same samples. The voltages may be deviations from a mean or trim."""


@dataclass(frozen=True)
class Request:
    """The options of a fit: method, order, sampling intervals, effects, the model's name."""

    method: str
    order: int | None
    """Number of states of a black box; None: the order search chooses it."""
    intervals_s: tuple[float, ...]
    """s: the sampling intervals that the order search tries."""
    name: str
    terms: tuple[str, ...] | None = None
    """Names of the effects that a physical model includes; None: the method's default."""
    partial: tuple[Recording, ...] = ()
    """Recordings that lack roll, pitch or yaw, for methods that can use them."""


@dataclass(frozen=True)
class Parameter:
    """An estimated physical parameter: its value, standard deviation (NaN if unknown) and unit."""

    value: float
    std: float
    unit: str
    bound: float = np.nan
    """The Cramér–Rao bound on ``std``; NaN where the method has none."""
    nominal: float = np.nan
    """The value in the rig's profile; NaN where the profile has none."""
    verdict: str = ""
    """Why the value is unreliable; empty if it is reliable."""
    absent: bool = False
    """True if the value is at the bound that means "no effect" (`PhysicalFit.absent`)"""


@dataclass(frozen=True)
class Pole:
    """A continuous-time pole (rad/s), with standard deviations of its real and imaginary part.

    An unknown standard deviation is NaN.
    """

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
    """Return the poles sorted by real part, the largest first."""
    return tuple(sorted(poles, key=lambda p: (-p.value.real, p.value.imag)))


@dataclass(frozen=True, eq=False)
class CandidateOrder:
    """A candidate of the order search: a black box of one order, fitted at one sampling interval.

    The search compares the ``score``, which is the mean fit of the axes in %. ``bic`` is the
    Bayesian information criterion.
    """

    order: int
    interval_s: float
    score: float = -np.inf
    log_likelihood: float = -np.inf
    bic: float = np.inf
    problem: str = ""
    """Why the fit cannot be used; empty if it can."""

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
    """The fitted model, at the control rate"""
    order: int
    interval_s: float
    """s: sampling interval of the data that were fitted"""
    innovations: Callable[[Prepared, Sequence[RowRange]], Innovations]
    """Function (prepared, runs) → prediction errors and voltages per run of usable rows. The errors
    are those of predictions `test_interval_s` ahead, or of the simulation for output error. It can
    be pickled if it is no lambda or closure; so can ``response``."""
    poles: tuple[Pole, ...] = ()
    transfer: TransferFunctions | None = None
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    candidates: tuple[CandidateOrder, ...] = ()
    warnings: tuple[str, ...] = ()
    """Sentences on problems of the fit, or on limits of its use"""
    notes: tuple[str, ...] = ()
    """Sentences on choices of the method that the user did not request; no problems"""
    response: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]] | None = None
    """Function: frequencies ω (F,) rad/s → frequency response (F, 3, 2) rad/V from the two motors
    to the three angles, and its standard deviation; None if the model has no linear response"""
    test_interval_s: float | None = None
    """s: sampling interval of the errors that ``innovations`` returns; None: ``interval_s``."""
    correlation: np.ndarray | None = None
    """(n, n) correlation matrix of the ``parameters``, in their order."""
    method: str = ""
    """Name of the method that made the fit; empty if it is the one that the user requested."""
