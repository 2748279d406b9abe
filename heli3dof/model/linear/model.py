"""`LinearModel`: a discrete-time state-space model in innovation form, about a trim.

The hover model and all black-box models have this form; the hover model has K = 0. The equations
are in `heli3dof.model.linear.parameters`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from heli3dof.arrays import ComplexArray, FloatArray
from heli3dof.model.base import LoopResult, LoopTask
from heli3dof.model.linear.parameters import LinearParameters
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import ControllerSpec

if TYPE_CHECKING:
    import control

    from heli3dof.model.discretisation import Continuous


@dataclass(frozen=True, eq=False, repr=False)
class LinearModel(LinearParameters):
    """A linear model with simulation, prediction, conversion and export."""

    def __repr__(self) -> str:
        axes = ", ".join(self.axes) or "no axes"
        return (
            f"<LinearModel {self.name!r} ({self.kind}): order {self.order}, every {self.dt:g} s,\n"
            f" {axes}>"
        )

    def rest_state(self, angle0: FloatArray) -> FloatArray:
        """Return the state (n,) of a rig at rest at ``angle0`` (3,) rad; see `initial_state`."""
        from heli3dof.model.linear.initial_state import rest_state

        return rest_state(self, angle0)

    def fly(self, task: LoopTask) -> LoopResult:
        """Return the closed-loop flight that ``task`` describes, simulated with this model."""
        from heli3dof.model.linear.closed_loop import fly

        return fly(self, task)

    def loop_poles(self, controller: ControllerSpec, dt: float) -> ComplexArray:
        """Return the closed-loop poles (rad/s, rightmost first) with the controller's gain.

        For the hover model, the loop is continuous, with ideal rates and two integrals, as in the
        paper. For other models, it is sampled every ``dt`` s and has the derivative filter. Then a
        pole z is returned as s = log(z)/dt, and z = 0 (a pure delay) is omitted. See
        `heli3dof.model.control.closed_loop_poles`.
        """
        from heli3dof.model.control.closed_loop_poles import ideal_loop_poles, sampled_loop_poles

        if self.physical_state:
            return ideal_loop_poles(self, controller)
        return sampled_loop_poles(self, controller, dt)

    def predict(self, recording: Recording, horizon_s: float) -> FloatArray:
        """Return the angles (N, 3) rad predicted ``horizon_s`` s ahead; see `linear.prediction`."""
        from heli3dof.model.linear.prediction import predict

        return predict(self, recording, horizon_s)

    def continuous(self) -> Continuous:
        """Return the continuous-time model; see `heli3dof.model.discretisation.continuous`."""
        from heli3dof.model.discretisation import continuous

        return continuous(self)

    def to_control(self, *, in_continuous_time: bool = False) -> control.StateSpace:
        """Return a python-control ``StateSpace`` from motor voltages (V) to angles (rad).

        Inputs and outputs are differences from the trim. The states of the hover model are r, p,
        psi and their rates; the states of other models are x[0], x[1], …
        """
        from heli3dof.model.discretisation import HOVER_STATES, to_control

        states = HOVER_STATES if self.physical_state else None
        return to_control(self, in_continuous_time=in_continuous_time, states=states)

    def to_transfer_function(self) -> control.TransferFunction:
        """Return the 3 × 2 transfer functions in s (rad/V) as a python-control object."""
        from heli3dof.model.discretisation import to_transfer_function

        return to_transfer_function(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the model as a dict for its JSON file; see ``docs/reference/model-file.md``."""
        return {
            "form": "linear",
            "name": self.name,
            "kind": self.kind,
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


def _lists(a: FloatArray) -> Any:
    if a.ndim > 1:
        return [_lists(row) for row in a]
    return [float(x) if np.isfinite(x) else None for x in a]
