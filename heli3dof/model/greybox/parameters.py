"""`GreyBoxParameters`: a profile, its effects and their values, with noise and covariance.

    M(q) q̈ + h(q, q̇) = Q(q, F) + effects,      τ_m Ḟ_i = K_f g_i f(V_i) − F_i

as in `heli3dof.model.physics.rigid_body`, with the effects that ``terms`` names
(`heli3dof.model.effects`). `heli3dof.model.greybox.model.GreyBoxModel` adds simulation, prediction
and export; the modules with those algorithms need only this class.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from heli3dof.model.effects import terms
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile


@dataclass(frozen=True, eq=False)
class GreyBoxParameters:
    """Values (n,) in the units and the order of ``structure.free``.

    Reading `structure` raises UsageError for an unknown term.
    """

    name: str
    profile: Profile
    terms: tuple[str, ...]
    values: np.ndarray
    noise: np.ndarray
    """(3,) rad/s² per √Hz: white angular acceleration on roll, pitch, yaw."""
    covariance: np.ndarray
    """(n, n) of the values; NaN where unknown."""
    jitter_s: float = 0.0
    """s: standard deviation of the sampling instants."""
    varying: Mapping[str, float] = field(default_factory=dict)
    """Parameters that differ between recordings: name → standard deviation about the value, in its
    unit. Prediction re-estimates them (`heli3dof.model.estimation.ekf_jitter`)."""
    extra: Mapping[str, Any] = field(default_factory=dict)
    """Other content of the model file: recordings, verdicts, versions."""
    kind: str = "greybox"

    @cached_property
    def structure(self) -> Structure:
        """The profile with the terms."""
        return Structure(self.profile, terms(self.terms))

    @property
    def parameters(self) -> Mapping[str, float]:
        """Name → value, in the unit of `Structure.free`."""
        return dict(zip(self.structure.names, self.values.tolist(), strict=True))

    @property
    def std(self) -> np.ndarray:
        """(n,) standard deviations in the units of the values."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @cached_property
    def _filtered(self) -> WeakKeyDictionary[Recording, Any]:
        """Filter results by recording; see `heli3dof.model.greybox.prediction.filtered`."""
        return WeakKeyDictionary()
