"""`GreyBoxModel`: the rigid body with a choice of effects, its numbers and how sure they are.

    M(q) q̈ + h(q, q̇) = Q(q, F) + effects,      τ_m Ḟ_i = K_f g_i f(V_i) − F_i

as in `heli3dof.model.physics.rigid_body`, with the terms named in ``terms``
(`heli3dof.model.effects`). What it can do stands in files of its own (`greybox_fly`,
`greybox_predict`, `greybox_linear`); the methods here only lead there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from heli3dof.model.base import LoopResult, LoopTask
from heli3dof.model.effects import terms
from heli3dof.model.linear.model import LinearModel
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import ControllerSpec, Profile


@dataclass(frozen=True, eq=False)
class GreyBoxModel:
    """Values (n,) in the units and the order of ``structure.free``.

    Raises UsageError for a term that is not known.
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
    """s: how far sampling instants scatter, standard deviation."""
    varying: Mapping[str, float] = field(default_factory=dict)
    """Parameters that differ from recording to recording, about their value, with this standard
    deviation in their unit: `predict` re-estimates them (`heli3dof.model.estimation.ekf_jitter`).
    """
    extra: Mapping[str, Any] = field(default_factory=dict)
    """Whatever else belongs in the model file: recordings, verdicts, versions."""
    kind: str = "greybox"

    @cached_property
    def structure(self) -> Structure:
        """The profile with the terms."""
        return Structure(self.profile, terms(self.terms))

    @property
    def parameters(self) -> Mapping[str, float]:
        """Name → value, in the unit that `Structure.free` gives."""
        return dict(zip(self.structure.names, self.values.tolist(), strict=True))

    @property
    def std(self) -> np.ndarray:
        """(n,) standard deviations in the units of the values."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @cached_property
    def _filtered(self) -> WeakKeyDictionary[Recording, Any]:
        return WeakKeyDictionary()

    def fly(self, task: LoopTask) -> LoopResult:
        """The sampled closed loop on this model; see `heli3dof.model.greybox.closed_loop`."""
        from heli3dof.model.greybox.closed_loop import fly

        return fly(self, task)

    def loop_poles(self, controller: ControllerSpec, dt: float) -> np.ndarray:
        """(m,) rad/s, rightmost first: the sampled loop's, linearised at level hover."""
        from heli3dof.model.control.closed_loop_poles import sampled_loop_poles

        return sampled_loop_poles(self.linear(dt), controller, dt)

    def predict(self, recording: Recording, horizon_s: float) -> np.ndarray:
        """(N, 3) rad, predictions made ``horizon_s`` earlier; see `greybox_predict`."""
        from heli3dof.model.greybox.prediction import predict

        return predict(self, recording, horizon_s)

    def linear(self, dt: float | None = None) -> LinearModel:
        """Linearised at level hover, sampled every ``dt`` s; see `greybox_linear`."""
        from heli3dof.model.greybox.linearisation import linear

        return linear(self, self.profile.dt if dt is None else dt)

    def to_dict(self) -> dict[str, Any]:
        """The model file's content; see ``docs/reference/model-file.md``."""
        from heli3dof.model.serialization.greybox import to_dict

        return to_dict(self)


def nominal(profile: Profile, names: tuple[str, ...] = (), **values: float) -> GreyBoxModel:
    """The profile's own rigid body with these terms, at their starting values or those given.

    Values are given by parameter name, for instance ``{"motor.lag.time_constant_s": 0.1}``.
    """
    structure = Structure(profile, terms(names))
    n = len(structure.free)
    return GreyBoxModel(
        "rigid-body", profile, names, structure.values_of(values), np.zeros(3),
        np.full((n, n), np.nan),
    )  # fmt: skip
