"""`LinearModel`: a discrete-time state-space model in innovation form, about a trim.

    x[k+1] = A x[k] + B (V[k] − u0) + K e[k]
      y[k] = C x[k] + y0 + e[k],      cov e = S

V (V) is held from k to k+1; y is (r, p, ψ) in rad. Hover and black-box models both are of this
form; the hover model has K = 0. What a model can do stands in files of its own; the methods here
only lead there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.errors import RecordingError
from heli3dof.model.base import LoopResult, LoopTask
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import ControllerSpec

if TYPE_CHECKING:
    import control

    from heli3dof.model.discretisation import Continuous

DT_TOLERANCE = 0.01
"""How far a recording's sample interval may be from the model's, as a share of it."""


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Shapes: A (n, n), B (n, 2), C (3, n), K (n, 3), S (3, 3), u0 (2,) V, y0 (3,) rad."""

    name: str
    kind: str
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    """A row that is NaN or zero throughout: that axis is not modelled."""
    K: np.ndarray
    S: np.ndarray
    """rad²; NaN where nothing is known of the noise."""
    u0: np.ndarray
    y0: np.ndarray
    dt: float
    """s"""
    extra: Mapping[str, Any] = field(default_factory=dict)
    """Whatever else belongs in the model file: standard deviations, recordings, versions."""
    exact_hold: bool = False
    """True where A, B are the zero-order hold of a model that is given in continuous time (hover,
    eq (17)). Such a model serves every sample interval; an identified one only its own."""

    @property
    def order(self) -> int:
        return int(self.A.shape[0])

    @property
    def modelled(self) -> np.ndarray:
        """(3,) bool: the axes on which the model says anything."""
        return np.asarray(np.isfinite(self.C).all(axis=1) & (self.C != 0).any(axis=1))

    @property
    def axes(self) -> tuple[str, ...]:
        """The names of the axes that are modelled."""
        return tuple(a for a, there in zip(AXES, self.modelled, strict=True) if there)

    @property
    def physical_state(self) -> bool:
        """True where the state is (r, p, ψ, ṙ, ṗ, ψ̇) itself, as in eq (8)."""
        return self.exact_hold and np.array_equal(self.C, np.eye(3, 6))

    def at(self, dt: float) -> LinearModel:
        """This model for a sample interval ``dt`` (s).

        Models of a continuous origin are discretised anew. Raises RecordingError for the others
        where dt differs from theirs by more than 1 %.
        """
        off = abs(dt / self.dt - 1)
        if self.exact_hold and off > 1e-9:
            from heli3dof.model.discretisation import held, released

            c = released(self.A, self.B, self.dt)
            if c is not None:
                A, B = held(*c, dt)
                return replace(self, A=A, B=B, dt=dt)
        if off <= DT_TOLERANCE:
            return self
        raise RecordingError(
            f"The model {self.name!r} is for samples every {self.dt * 1e3:g} ms, "
            f"not every {dt * 1e3:g} ms.",
            cause="it was identified on recordings made at another rate.",
            fix="heli3dof identify a recording made at this rate",
        )

    def rest_state(self, angle0: np.ndarray) -> np.ndarray:
        """(n,) the state at rest at ``angle0`` (3,) rad; see `model.linear.initial_state`."""
        from heli3dof.model.linear.initial_state import rest_state

        return rest_state(self, angle0)

    def fly(self, task: LoopTask) -> LoopResult:
        """The sampled closed loop on this model; see `heli3dof.model.linear.closed_loop`."""
        from heli3dof.model.linear.closed_loop import fly

        return fly(self, task)

    def loop_poles(self, controller: ControllerSpec, dt: float) -> np.ndarray:
        """(m,) rad/s, rightmost first: poles of this model in the loop with the gain.

        Where the state is physical (hover), the continuous loop with ideal rates and the two
        integrals, as in the paper; otherwise the sampled loop with the true derivative filter
        every ``dt`` s, mapped by s = log(z)/dt. See `heli3dof.model.control.closed_loop_poles`.
        """
        from heli3dof.model.control.closed_loop_poles import ideal_loop_poles, sampled_loop_poles

        if self.physical_state:
            return ideal_loop_poles(self, controller)
        return sampled_loop_poles(self, controller, dt)

    def predict(self, recording: Recording, horizon_s: float) -> np.ndarray:
        """(N, 3) rad, predictions made ``horizon_s`` earlier; see `model.linear.prediction`."""
        from heli3dof.model.linear.prediction import predict

        return predict(self, recording, horizon_s)

    def continuous(self) -> Continuous:
        """ẋ = A x + B ũ, ỹ = C x + D ũ, and how it was found; see `model.discretisation`."""
        from heli3dof.model.discretisation import continuous

        return continuous(self)

    def to_control(self, *, in_continuous_time: bool = False) -> control.StateSpace:
        """A python-control ``StateSpace`` about the trim, V to rad."""
        from heli3dof.model.discretisation import to_control

        return to_control(self, in_continuous_time=in_continuous_time)

    def to_transfer_function(self) -> control.TransferFunction:
        """Continuous-time transfer functions as a python-control 3 × 2 object, rad/V."""
        from heli3dof.model.discretisation import to_transfer_function

        return to_transfer_function(self)

    def to_dict(self) -> dict[str, Any]:
        """The model file's content; see ``docs/reference/model-file.md``."""
        from heli3dof.model.serialization.linear import to_dict

        return to_dict(self)
