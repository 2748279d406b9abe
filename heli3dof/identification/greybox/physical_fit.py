"""`PhysicalFit`: base class of the fits by maximum likelihood and by multi-step predictions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np

from heli3dof.model.physics.parametrisation import Structure


class PhysicalFit(ABC):
    """Base class of a fit of the n free parameters of a model ``structure``, in its order."""

    @property
    @abstractmethod
    def structure(self) -> Structure: ...

    @property
    @abstractmethod
    def theta(self) -> np.ndarray:
        """(n,) coordinates: a parameter's logarithm, or its value divided by a typical size"""

    @property
    @abstractmethod
    def covariance(self) -> np.ndarray:
        """Covariance (n, n) of the parameters in their units"""

    def values_at(self, theta: np.ndarray) -> np.ndarray:
        """Convert coordinates (n,) to values in their units."""
        return np.array([f.outward(c) for f, c in zip(self.structure.free, theta, strict=True)])

    @cached_property
    def values(self) -> np.ndarray:
        """(n,) in their units"""
        return self.values_at(self.theta)

    @cached_property
    def slopes(self) -> np.ndarray:
        """(n,) ∂value/∂coordinate"""
        return np.array([f.slope(v) for f, v in zip(self.structure.free, self.values, strict=True)])

    @property
    def std(self) -> np.ndarray:
        """Standard deviations (n,) in the parameters' units"""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def correlation(self) -> np.ndarray:
        """(n, n)"""
        return np.asarray(self.covariance / np.outer(self.std, self.std))
