"""`GreyBoxParameters`: the data of a grey-box model: profile, effects, values, covariance, noise.

    M(q) q̈ + h(q, q̇) = Q(q, F) + effects,      τ_m Ḟ_i = K_f g_i f(V_i) − F_i

q are roll, pitch, yaw, M the mass matrix, h Coriolis and centrifugal torques, Q the torques of
thrust and gravity. F_i is the thrust of rotor i with the lag τ_m, K_f the thrust per volt, g_i a
gain and f a characteristic of the voltage V_i. Details: modules `rigid_body` and `rotor` of
`heli3dof.model.physics`, and `heli3dof.model.effects`. `heli3dof.model.greybox.model.GreyBoxModel`
adds simulation, prediction and export.
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
    """The data of a grey-box model: a rig's profile, its effects and their parameter values.

    ``values`` (n,) are in the order of ``structure.free``. The property `structure` raises
    UsageError for an unknown effect in ``terms``.
    """

    name: str
    profile: Profile
    terms: tuple[str, ...]
    values: np.ndarray
    noise: np.ndarray
    """(3,) rad/s²/√Hz, intensity of the white process noise: acceleration of roll, pitch, yaw."""
    covariance: np.ndarray
    """(n, n), covariance of the values; NaN where unknown."""
    jitter_s: float = 0.0
    """s, sampling jitter: standard deviation of the sampling instants."""
    varying: Mapping[str, float] = field(default_factory=dict)
    """Parameters that differ between recordings: name → standard deviation about the value, in its
    unit. Prediction re-estimates them (`heli3dof.model.estimation.ekf_jitter`)."""
    extra: Mapping[str, Any] = field(default_factory=dict)
    """Other content of the model file: recordings, validation verdicts, versions."""
    kind: str = "greybox"

    @cached_property
    def structure(self) -> Structure:
        return Structure(self.profile, terms(self.terms))

    @property
    def parameters(self) -> Mapping[str, float]:
        """Return {parameter name: value}; `Structure.free` states the units."""
        return dict(zip(self.structure.names, self.values.tolist(), strict=True))

    @property
    def std(self) -> np.ndarray:
        """Return the standard deviations (n,) of the parameter values, in their units."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @cached_property
    def _filtered(self) -> WeakKeyDictionary[Recording, Any]:
        """Return the cache {recording: result of `heli3dof.model.greybox.prediction.filtered`}."""
        return WeakKeyDictionary()
