"""`GreyBoxModel`: the nonlinear rigid body with selected effects, fitted or nominal.

The equations are in `heli3dof.model.greybox.parameters`.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from heli3dof.arrays import ComplexArray, FloatArray
from heli3dof.model.base import LoopResult, LoopTask
from heli3dof.model.effects import plug_ins, terms
from heli3dof.model.greybox.parameters import GreyBoxParameters
from heli3dof.model.linear.model import LinearModel
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import ControllerSpec, Profile

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False, repr=False)
class GreyBoxModel(GreyBoxParameters):
    """A nonlinear grey-box model with simulation, prediction, linearisation and export."""

    def __repr__(self) -> str:
        effects = ", ".join(self.terms[:4]) + (", …" if len(self.terms) > 4 else "")
        return (
            f"<GreyBoxModel {self.name!r}: {len(self.values)} parameters,\n"
            f" {len(self.terms)} effects{': ' * bool(effects)}{effects}>"
        )

    def fly(self, task: LoopTask) -> LoopResult:
        """Return the closed-loop flight that ``task`` describes, simulated with this model."""
        from heli3dof.model.greybox.closed_loop import fly

        return fly(self, task)

    def loop_poles(self, controller: ControllerSpec, dt: float) -> ComplexArray:
        """Return the poles (rad/s, rightmost first) of the closed loop, sampled every ``dt`` s.

        A pole z of the sampled loop is returned as s = log(z)/dt.
        """
        from heli3dof.model.control.closed_loop_poles import sampled_loop_poles

        return sampled_loop_poles(self.linear(dt), controller, dt)

    def predict(self, recording: Recording, horizon_s: float) -> FloatArray:
        """Return the angles (N, 3) rad predicted ``horizon_s`` s ahead (`greybox.prediction`)."""
        from heli3dof.model.greybox.prediction import predict

        return predict(self, recording, horizon_s)

    def linear(self, dt: float | None = None) -> LinearModel:
        """Return the linearised model at hover, sampled every ``dt`` s (None: control period)."""
        from heli3dof.model.greybox.linearisation import linear

        return linear(self, self.profile.dt if dt is None else dt)[0]

    def to_control(
        self, *, in_continuous_time: bool = False, dt: float | None = None
    ) -> control.StateSpace:
        """Return the linearisation at level hover as a python-control ``StateSpace``.

        States: r, p, psi (rad), their rates (rad/s), F_front, F_back (N) if the rotors lag, then
        the delayed voltages. Sampled every ``dt`` s (default: the control period) or in continuous
        time. Raises CheckFailed if the model cannot hover level.
        """
        from heli3dof.model.discretisation import to_control
        from heli3dof.model.greybox.linearisation import linear

        model, states = linear(self, self.profile.dt if dt is None else dt)
        return to_control(model, in_continuous_time=in_continuous_time, states=states)

    def to_dict(self) -> dict[str, Any]:
        """Return the model as a dict for its JSON file; see ``docs/reference/model-file.md``."""
        known = plug_ins()
        used = (t.effect.name for t in self.structure.terms)
        from_others = {name: asdict(known[name]) for name in used if name in known}
        return {
            "form": "greybox",
            "name": self.name,
            "kind": self.kind,
            "profile": self.profile.to_dict(),
            "terms": list(self.terms),
            "parameters": [
                {
                    "name": f.name,
                    "value": float(v),
                    "std": float(s),
                    "unit": f.unit,
                    "nominal": float(f.start) if f.term is None else None,
                }
                for f, v, s in zip(self.structure.free, self.values, self.std, strict=True)
            ],
            "covariance": self.covariance.tolist(),
            "acceleration_noise_rad_per_s2_per_sqrtHz": self.noise.tolist(),
            "timing_jitter_s": self.jitter_s,
            "varying_by_recording": dict(self.varying),
            "extra": dict(self.extra),
            **({"plug_ins": from_others} if from_others else {}),
        }


def nominal(profile: Profile, names: tuple[str, ...] = (), **values: float) -> GreyBoxModel:
    """Return a model of a profile's rig with the effects ``names``; nothing is estimated.

    ``values`` are parameter values by name (``**{"motor.lag.time_constant_s": 0.1}``); other
    parameters have their starting values.
    """
    structure = Structure(profile, terms(names))
    n = len(structure.free)
    return GreyBoxModel(
        "rigid-body", profile, names, structure.values_of(values), np.zeros(3),
        np.full((n, n), np.nan),
    )  # fmt: skip
