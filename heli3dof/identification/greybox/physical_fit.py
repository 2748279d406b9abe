"""`PhysicalFit`: what fits by likelihood and by multi-step prediction have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np

from heli3dof.model.physics.parametrisation import Structure


class PhysicalFit(ABC):
    """n fitted parameters in the order of ``structure.free``; frozen."""

    @property
    @abstractmethod
    def structure(self) -> Structure: ...

    @property
    @abstractmethod
    def theta(self) -> np.ndarray:
        """(n,) coordinates"""

    @property
    @abstractmethod
    def covariance(self) -> np.ndarray:
        """(n, n) of the values, in their units"""

    def values_at(self, theta: np.ndarray) -> np.ndarray:
        """(n,) coordinates → values in their units"""
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
        """(n,) in the units of the values"""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def correlation(self) -> np.ndarray:
        """(n, n)"""
        return np.asarray(self.covariance / np.outer(self.std, self.std))
