"""`LinearModel`: a discrete-time state-space model in innovation form, about a trim.

    x[k+1] = A x[k] + B (V[k] − u0) + K e[k]
      y[k] = C x[k] + y0 + e[k],      cov e = S

V (V) is held from k to k+1; y is (r, p, ψ) in rad; u0, y0 are the trim, e the innovations, K the
Kalman gain. The hover model and all black-box models have this form; the hover model has K = 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from heli3dof.arrays import ComplexArray, FloatArray
from heli3dof.axes import AXES
from heli3dof.errors import RecordingError
from heli3dof.model.base import LoopResult, LoopTask, checked_time
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import ControllerSpec, Profile, recorded_profile

if TYPE_CHECKING:
    import control

    from heli3dof.model.discretisation import Continuous

DT_TOLERANCE = 0.01
"""Largest relative difference between a recording's sample interval and the model's ``dt``."""
_KEYS_SHAPES = {"A": "nn", "B": "n2", "C": "3n", "K": "n3", "S": "33", "u0_V": "2", "y0_rad": "3"}


@dataclass(frozen=True, eq=False, repr=False)
class LinearModel:
    """A linear discrete-time model: its matrices, trim and sample interval.

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
    sampled_from: Continuous | None = None
    """The continuous-time model of which A, B are the zero-order hold; None: not known"""
    file: Path | None = None
    """The file from which the model was read"""
    profile: Profile | None = None
    """The rig's profile, with which `simulate` flies the model; None: unknown"""

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
        model's interval. Otherwise raises RecordingError; for ``dt`` ≤ 0, UsageError.
        """
        off = abs(checked_time(dt, "dt") / self.dt - 1)
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

    def __repr__(self) -> str:
        axes = ", ".join(self.axes) or "no axes"
        return (
            f"<LinearModel {self.name!r} ({self.kind}): order {self.order}, every {self.dt:g} s,\n"
            f" {axes}>"
        )

    def fly(self, task: LoopTask) -> LoopResult:
        """Return the closed-loop flight that ``task`` describes, simulated with this model."""
        from heli3dof.model.linear.closed_loop import fly

        return fly(self, task)

    def loop_poles(self, controller: ControllerSpec, dt: float) -> ComplexArray:
        """Return the closed-loop poles (rad/s, rightmost first) with the controller's gain.

        For the hover model, the loop is continuous, with exact rates (as in the paper) and two
        error integrals. For other models, the loop is sampled every ``dt`` s and has the derivative
        filter. Then a pole z is returned as s = log(z)/dt, and z = 0 (a pure delay) is omitted. See
        `heli3dof.model.control.closed_loop_poles`.
        """
        from heli3dof.model.control.closed_loop_poles import ideal_loop_poles, sampled_loop_poles

        if self.physical_state:
            return ideal_loop_poles(self, controller)
        return sampled_loop_poles(self, controller, dt)

    def predict(self, recording: Recording, horizon_s: float) -> FloatArray:
        """Return the angles (N, 3) rad predicted ``horizon_s`` s ahead; see `linear.prediction`."""
        from heli3dof.model.linear.prediction import predict

        return predict(self, recording, checked_time(horizon_s, "horizon_s"))

    def continuous(self) -> Continuous:
        """Return the continuous-time model; see `heli3dof.model.discretisation.continuous`."""
        from heli3dof.model.discretisation import continuous

        return continuous(self)

    def to_control(
        self, *, in_continuous_time: bool = False, dt: float | None = None
    ) -> control.StateSpace:
        """Return a python-control ``StateSpace`` from motor voltages (V) to angles (rad).

        Inputs and outputs are differences from the trim. The states of the hover model are r, p,
        psi and their rates; the states of other models are x[0], x[1], … The result is sampled
        every ``dt`` s (default: the model's interval; see `at`) or in continuous time.
        """
        from heli3dof.model.discretisation import HOVER_STATES, to_control

        states = HOVER_STATES if self.physical_state else None
        model = self if dt is None else self.at(dt)
        return to_control(model, in_continuous_time=in_continuous_time, states=states)

    def to_transfer_function(self) -> control.TransferFunction:
        """Return the 3 × 2 transfer functions in s (rad/V) as a python-control object."""
        from heli3dof.model.discretisation import to_transfer_function

        return to_transfer_function(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the model as a dict for its JSON file; see ``docs/reference/model-file.md``."""
        profile = {} if self.profile is None else {"profile": self.profile.to_dict()}
        return {
            "form": "linear",
            "name": self.name,
            "kind": self.kind,
            **profile,
            "dt_s": self.dt,
            "order": self.order,
            "exact_hold": self.exact_hold,
            "A": _lists(self.A),
            "B": _lists(self.B),
            "C": _lists(self.C),
            "K": _lists(self.K),
            "S": _lists(self.S),
            "u0_V": _lists(self.u0),
            "y0_rad": _lists(self.y0),
            "extra": dict(self.extra),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Return the model from the output of `LinearModel.to_dict`.

        Raises KeyError for a missing key, TypeError or ValueError for invalid content.
        """
        n = len(data["A"])
        sizes = {"n": n, "2": 2, "3": 3}
        arrays: dict[str, Any] = {}
        for key, letters in _KEYS_SHAPES.items():
            shape = tuple(sizes[s] for s in letters)
            array = np.array(data[key], dtype=float)
            if array.shape != shape:
                raise ValueError(f"{key} has the shape {array.shape}, not {shape}")
            if key not in {"C", "S"} and not np.isfinite(array).all():
                raise ValueError(f"{key} holds null where a number belongs")
            arrays[key] = array
        dt = float(data["dt_s"])
        if not 0 < dt < np.inf:
            raise ValueError(f"dt_s is {dt}, not a positive number of seconds")
        return cls(
            name=str(data["name"]),
            kind=str(data["kind"]),
            dt=dt,
            u0=arrays.pop("u0_V"),
            y0=arrays.pop("y0_rad"),
            extra=dict(data.get("extra", {})),
            exact_hold=bool(data.get("exact_hold", False)),
            profile=recorded_profile(data["profile"]) if "profile" in data else None,
            **arrays,
        )


def _lists(a: FloatArray) -> Any:
    if a.ndim > 1:
        return [_lists(row) for row in a]
    return [float(x) if np.isfinite(x) else None for x in a]
