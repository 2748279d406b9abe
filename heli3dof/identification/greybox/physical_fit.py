"""`PhysicalFit`: base class of the fits by maximum likelihood and by multi-step predictions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np

from heli3dof.model.physics.parametrisation import FreeParameter, Structure

NEAR_BOUND = 0.02
"""A value at most this far above its lower bound counts as at the bound. The distance is relative
to the bound if the logarithm is fitted, otherwise to the parameter's typical size. Chosen."""


class PhysicalFit(ABC):
    """Base class of a fit of physical parameters: n values, in the order of ``structure.free``."""

    @property
    @abstractmethod
    def structure(self) -> Structure: ...

    @property
    def free(self) -> tuple[FreeParameter, ...]:
        return self.structure.free

    @property
    @abstractmethod
    def theta(self) -> np.ndarray:
        """Return the scaled parameters (n,): logarithms, or values divided by a typical size."""

    @property
    @abstractmethod
    def covariance(self) -> np.ndarray:
        """Return the covariance (n, n) of the parameters in their units."""

    @cached_property
    def values(self) -> np.ndarray:
        """Return the fitted values (n,) of the parameters, in their units."""
        return self.structure.unscaled(self.theta)

    @cached_property
    def slopes(self) -> np.ndarray:
        """Return the derivative (n,) of each parameter with respect to the scaled one (`theta`)."""
        return np.array([f.slope(v) for f, v in zip(self.structure.free, self.values, strict=True)])

    @property
    def absent(self) -> np.ndarray:
        """Return (n,) bool: True for each parameter whose effect the fit did not find.

        Such a parameter is at its lower bound, where the effect vanishes: for example, a lag at its
        least value of 1 ms.
        """
        return np.array([
            f.null <= f.low and v - f.low <= NEAR_BOUND * (f.low if f.log else f.typical)
            for f, v in zip(self.free, self.values, strict=True)
        ])  # fmt: skip

    @property
    def std(self) -> np.ndarray:
        """Return the standard deviations (n,) of the parameters, in their units."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def correlation(self) -> np.ndarray:
        """Return the correlation matrix (n, n) of the parameters."""
        return np.asarray(self.covariance / np.outer(self.std, self.std))
