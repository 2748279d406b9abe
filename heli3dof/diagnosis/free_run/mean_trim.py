"""Combine the trim torque with the mean of the torques that differ by recording.

A multi-step fit has the trim torque T_g and one torque τ_i for each recording (`mass.imbalance`).
No recording separates the mean τ̄ of these torques from T_g. So T_g + τ̄ replaces T_g, and zero
replaces τ̄. The result has the covariance J C Jᵀ. C is the covariance of the fit, J the derivatives
of the new parameters by the old ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from heli3dof.identification.greybox.freeflight import WEIGHT
from heli3dof.identification.greybox.multistep import MultiStepFit
from heli3dof.identification.greybox.physical_fit import PhysicalFit
from heli3dof.model.physics.parametrisation import Structure


@dataclass(frozen=True, eq=False)
class MeanTrimFit(PhysicalFit):
    """A fit whose trim torque T_g includes the mean of the torques that differ by recording."""

    fit: MultiStepFit

    @property
    def structure(self) -> Structure:
        return self.fit.structure

    @cached_property
    def _combination(self) -> np.ndarray:
        names = self.structure.names
        J = np.eye(len(names))
        if WEIGHT in names:
            T_g, weight = names.index("T_g"), names.index(WEIGHT)
            J[T_g, weight], J[weight, weight] = 1.0, 0.0
        return J

    @property
    def theta(self) -> np.ndarray:
        values = self._combination @ self.fit.values
        return np.array([f.scaled(v) for f, v in zip(self.free, values, strict=True)])

    @cached_property
    def covariance(self) -> np.ndarray:
        return np.asarray(self._combination @ self.fit.covariance @ self._combination.T)
