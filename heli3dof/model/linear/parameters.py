"""`LinearParameters`: matrices, trim and sample interval of a discrete-time state-space model.

    x[k+1] = A x[k] + B (V[k] − u0) + K e[k]
      y[k] = C x[k] + y0 + e[k],      cov e = S

V (V) is held from k to k+1; y is (r, p, ψ) in rad; u0, y0 are the trim, e the innovations, K the
Kalman gain. `heli3dof.model.linear.model.LinearModel` adds simulation, prediction and export.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from heli3dof.axes import AXES
from heli3dof.errors import RecordingError

DT_TOLERANCE = 0.01
"""Largest relative difference between a recording's sample interval and the model's ``dt``."""


@dataclass(frozen=True, eq=False)
class LinearParameters:
    """The matrices, trim and sample interval of a linear discrete-time model.

    Shapes: A (n, n), B (n, 2), C (3, n), Kalman gain K (n, 3), innovation covariance S (3, 3). The
    trim is u0 (2,) V and y0 (3,) rad; dt in s.
    """

    name: str
    kind: str
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    """(3, n); an axis whose row is NaN or zero is not modelled."""
    K: np.ndarray
    S: np.ndarray
    """(3, 3) rad², covariance of the innovations; NaN where unknown."""
    u0: np.ndarray
    y0: np.ndarray
    dt: float
    """s, sample interval"""
    extra: Mapping[str, Any] = field(default_factory=dict)
    """Other content of the model file: standard deviations, recordings, versions."""
    exact_hold: bool = False
    """True if A, B are the zero-order hold of a continuous-time model (hover, eq (17)), so that the
    model can be resampled. An identified model is valid at its own interval only."""

    @property
    def order(self) -> int:
        return int(self.A.shape[0])

    @property
    def modelled(self) -> np.ndarray:
        """Return which axes the model contains, (3,) bool: their rows of C are finite and not 0."""
        return np.asarray(np.isfinite(self.C).all(axis=1) & (self.C != 0).any(axis=1))

    @property
    def axes(self) -> tuple[str, ...]:
        return tuple(a for a, there in zip(AXES, self.modelled, strict=True) if there)

    @property
    def physical_state(self) -> bool:
        """Return True if the state is (r, p, ψ, ṙ, ṗ, ψ̇), as in the paper's eq (8)."""
        return self.exact_hold and np.array_equal(self.C, np.eye(3, 6))

    def at(self, dt: float) -> Self:
        """Return this model for the sample interval ``dt`` (s), resampled if that is possible.

        Resampling is possible if the model is the exact zero-order hold of a continuous-time model
        (field `exact_hold`). Any other model is returned unchanged if ``dt`` is within 1 % of the
        model's interval. Otherwise raises RecordingError.
        """
        off = abs(dt / self.dt - 1)
        if self.exact_hold and off > 1e-9:
            from heli3dof.model.discretisation import c2d_zoh, d2c_zoh

            c = d2c_zoh(self.A, self.B, self.dt)
            if c is not None:
                A, B = c2d_zoh(*c, dt)
                return replace(self, A=A, B=B, dt=dt)
        if off <= DT_TOLERANCE:
            return self
        raise RecordingError(
            f"The model {self.name!r} is for samples every {self.dt * 1e3:g} ms, "
            f"not every {dt * 1e3:g} ms.",
            cause="it was identified on recordings made at another rate.",
            fix="heli3dof identify a recording made at this rate",
        )
