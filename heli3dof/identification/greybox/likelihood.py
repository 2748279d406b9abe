"""Compute the likelihood of recordings for given rig parameters, its score and information.

    ℓ(θ, a) = Σ_k Σ_i ln Z_ik            a fit maximises ℓ + ln prior(θ)

Z_ik is the probability of reading k of axis i, given all earlier readings and reading k of the axes
before i. The filter of `heli3dof.model.estimation.ekf_quantised` computes it. θ (n,) are the scaled
parameters: logarithms, or multiples of a typical size (`FreeParameter.scaled`). The first
three elements of the noise vector a (4,) are the process noise on roll, pitch and yaw
(rad/s²/√Hz). The fourth is the sampling jitter (s). The prior N(start, spread²) of each parameter
is weak. It matters only for parameters on which the recordings have no information.

Far from the true parameters a simulation may diverge between two readings. Then ℓ = −∞, so a search
rejects these parameters. If the derivatives with respect to one parameter diverge, they are set to
zero, so only the prior changes this parameter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from heli3dof.model.effects import Term
from heli3dof.model.estimation.ekf_quantised import (
    FilterRun,
    filter_quantised,
    prediction_changes,
)
from heli3dof.model.estimation.filter_data import ENCODER_NOISE, Data, encoder_noise
from heli3dof.model.physics.parametrisation import Structure

DIFFERENCE = 1e-4
"""Step of the finite differences, in scaled parameters (which are of the order of one)"""
DIVERGED = 1e4
"""rad per scaled parameter: a larger tangent means that the simulation diverges. In flights,
tangents stay below 10; with negative dry friction they reached 1e243, whose square overflows."""


@dataclass(frozen=True, eq=False)
class Likelihood:
    """The likelihood of recorded data, a function of scaled parameters θ (n,) and noise a (4,)."""

    data: Data
    structure: Structure
    noise_steps: float = ENCODER_NOISE
    """Standard deviation of the encoder readings' noise, in encoder steps"""
    known_noise: tuple[bool, ...] = (False, False, False)
    """Roll, pitch, yaw: True if the axis' process noise is known, so that no fit changes it"""

    @property
    def free_noise(self) -> np.ndarray:
        """Return (3,) bool: the measured axes whose process noise a fit estimates."""
        return np.asarray(self.data.axes & ~np.array(self.known_noise))

    def with_term(self, term: Term) -> Likelihood:
        """Return the likelihood of the model with ``term`` added."""
        return replace(self, structure=self.structure.with_terms(term))

    @cached_property
    def prior_mean(self) -> np.ndarray:
        """Return the prior mean (n,) of the scaled parameters θ."""
        return self.structure.scaled(self.structure.start)

    @cached_property
    def prior_precision(self) -> np.ndarray:
        """Return the prior's precision (n,): 1/variance of each scaled parameter."""
        free = self.structure.free
        std = np.array([f.prior_std if f.log else f.prior_std / f.typical for f in free])
        return np.asarray(1.0 / std**2)

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the lowest and the highest allowed scaled parameters, (n,) each."""
        free = self.structure.free
        scaled = self.structure.scaled
        return scaled(f.low for f in free), scaled(f.high for f in free)

    def movable(self, theta: np.ndarray, g: np.ndarray) -> np.ndarray:
        """Return (n,) bool: True for the scaled parameters that a step along g can change.

        g (n,) is the log-likelihood's gradient. The other parameters are at a bound, and g points
        beyond it.
        """
        low, high = self.bounds
        return np.asarray(~(((theta <= low) & (g < 0)) | ((theta >= high) & (g > 0))))

    @cached_property
    def encoder_noise(self) -> np.ndarray:
        """Return the variance (3,) rad² of the encoder readings' white noise, by axis."""
        return encoder_noise(self.data, self.noise_steps)

    def values(self, theta: np.ndarray) -> np.ndarray:
        """Return the values (n,), in their units, of the scaled parameters ``theta`` (n,)."""
        return self.structure.unscaled(theta)

    def run(self, theta: np.ndarray, a: np.ndarray, *, keep: int = 1) -> FilterRun:
        """Return the filter's run over the data with scaled parameters θ (n,) and noise a (4,).

        The first three elements of ``a`` are the process noise on roll, pitch and yaw (rad/s²/√Hz).
        The fourth is the standard deviation of the sampling jitter (s). ``keep`` selects what is
        stored in addition to the log-likelihood (see `filter_quantised`).
        """
        return filter_quantised(
            self.structure, self.values(theta), self.data, a, self.encoder_noise, keep=keep
        )

    def loglik(self, theta: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the log-likelihood (3,) by axis, at scaled parameters θ (n,) and noise ``a`` (4,).

        The first three elements of ``a`` are the process noise on roll, pitch and yaw (rad/s²/√Hz).
        The fourth is the standard deviation of the sampling jitter (s).
        """
        return self.run(theta, a, keep=0).loglik

    def log_prior(self, theta: np.ndarray) -> float:
        return float(-0.5 * (self.prior_precision * (theta - self.prior_mean) ** 2).sum())

    def tangents(
        self, theta: np.ndarray, at: FilterRun, which: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the derivatives ∂c/∂θ (n, E) of the E predicted readings c of the run ``at``.

        ``theta`` = θ (n,): the run's scaled parameters. ``which``: indices of the parameters that
        get a row (None: all). The filter's gains stay fixed. Rows that `diverged` are zero.
        """
        d = self.data
        _, high = self.bounds
        which = np.arange(len(theta)) if which is None else which
        step = np.where(theta + DIFFERENCE > high, -DIFFERENCE, DIFFERENCE)
        moved = (self.values(theta + e) for e in np.diag(step)[which])
        sets = np.array([self.values(theta), *moved])
        D = np.zeros((len(sets), len(at.row)))
        prediction_changes(
            *self.structure.arguments(sets), d.blocks, d.free, d.t, d.h, d.V, d.y,
            at.row, at.state, at.c, at.g, at.w, at.K, D,
        )  # fmt: skip
        with np.errstate(over="ignore", invalid="ignore"):
            out = (D[1:] - D[0]) / step[which, None]
        return np.where(diverged(out)[:, None], 0.0, out)


def diverged(D: np.ndarray) -> np.ndarray:
    """Return (n,) bool: the rows of D (n, E) with a value that is not finite or is too large.

    Row j of D contains the derivatives of E predicted readings with respect to scaled parameter j.
    `DIVERGED` limits them.
    """
    return np.asarray(~(np.abs(D).max(axis=1, initial=0.0) < DIVERGED))


def score_and_information(at: FilterRun, D: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the likelihood's score (n,) and information (n, n), without the prior.

    The score is Σ g ∂c, the information Σ w ∂c ∂cᵀ, over the E readings of the filter run ``at``.
    Each column ∂c of D (n, E) is a predicted reading's gradient with respect to the scaled
    parameters. g and w are each reading's score and information (`FilterRun`).
    """
    return D @ at.g, (D * at.w) @ D.T
