"""`GreyBoxModel`: the nonlinear rigid body with selected effects, fitted or nominal.

    M(q) q̈ + h(q, q̇) = Q(q, F) + effects,      τ_m Ḟ_i = K_f g_i f(V_i) − F_i

q are roll, pitch, yaw, M the mass matrix, h Coriolis and centrifugal torques, Q the torques of
thrust and gravity. F_i is the thrust of rotor i with the lag τ_m, K_f the thrust per volt, g_i a
gain and f a function of the voltage V_i. Details: modules `rigid_body` and `rotor` of
`heli3dof.model.physics`, and `heli3dof.model.effects`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from heli3dof.arrays import ComplexArray, FloatArray
from heli3dof.errors import UsageError
from heli3dof.model.base import LoopResult, LoopTask, checked_time
from heli3dof.model.effects import PlugIn, broken, plug_ins, term, terms
from heli3dof.model.linear.model import LinearModel
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import ControllerSpec, Profile, recorded_profile

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False, repr=False)
class GreyBoxModel:
    """A nonlinear grey-box model: a rig's profile, its effects and their parameter values.

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
    """Parameters that differ between recordings: name → standard deviation about the value, in
    the parameter's unit. Prediction re-estimates them (`heli3dof.model.estimation.ekf_jitter`)."""
    extra: Mapping[str, Any] = field(default_factory=dict)
    """Other content of the model file: recordings, validation verdicts, versions."""
    kind: str = "greybox"
    file: Path | None = None
    """The file from which the model was read"""

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

    def __repr__(self) -> str:
        effects = ", ".join(self.terms[:4]) + (", …" if len(self.terms) > 4 else "")
        return (
            f"<GreyBoxModel {self.name!r}: {len(self.values)} parameters,\n"
            f" {len(self.terms)} effect{'s' * (len(self.terms) != 1)}"
            f"{': ' * bool(effects)}{effects}>"
        )

    def fly(self, task: LoopTask) -> LoopResult:
        """Return the closed-loop flight that ``task`` describes, simulated with this model."""
        from heli3dof.model.greybox.closed_loop import fly

        return fly(self, task)

    def loop_poles(self, controller: ControllerSpec, dt: float) -> ComplexArray:
        """Return the closed-loop poles (rad/s, rightmost first) of the model linearised at hover.

        The loop is sampled every ``dt`` s; a pole z of this loop is returned as s = log(z)/dt.
        """
        from heli3dof.model.control.closed_loop_poles import sampled_loop_poles

        return sampled_loop_poles(self.linear(dt), controller, dt)

    def predict(self, recording: Recording, horizon_s: float) -> FloatArray:
        """Return the angles (N, 3) rad predicted ``horizon_s`` s ahead (`greybox.prediction`)."""
        from heli3dof.model.greybox.prediction import predict

        return predict(self, recording, checked_time(horizon_s, "horizon_s"))

    def linear(self, dt: float | None = None) -> LinearModel:
        """Return the linearised model at hover, sampled every ``dt`` s (None: control period)."""
        from heli3dof.model.greybox.linearisation import linear

        return linear(self, self.profile.dt if dt is None else checked_time(dt, "dt"))[0]

    def to_control(
        self, *, in_continuous_time: bool = False, dt: float | None = None
    ) -> control.StateSpace:
        """Return the linearisation at level hover as a python-control ``StateSpace``.

        States: r, p, psi (rad), their rates (rad/s), F_front, F_back (N) if the rotors lag, then
        the delayed voltages. The result is sampled every ``dt`` s (default: the control period) or
        in continuous time. Raises CheckFailed if the model cannot hover level.
        """
        from heli3dof.model.discretisation import to_control
        from heli3dof.model.greybox.linearisation import linear

        model, states = linear(self, self.profile.dt if dt is None else checked_time(dt, "dt"))
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

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Return the model from the output of `GreyBoxModel.to_dict`.

        Raises KeyError for a missing key, TypeError or ValueError for invalid content, and
        UsageError for an unknown effect. The message names the plug-in that provided the effect
        when the file was written.
        """
        names = tuple(str(t) for t in data["terms"])
        _check_terms(names, data.get("plug_ins", {}))
        values = np.array([p["value"] for p in data["parameters"]], dtype=float)
        n = len(values)
        model = cls(
            name=str(data["name"]),
            kind=str(data["kind"]),
            profile=recorded_profile(data["profile"]),
            terms=names,
            values=values,
            noise=np.array(data["acceleration_noise_rad_per_s2_per_sqrtHz"], dtype=float),
            covariance=np.array(data["covariance"], dtype=float).reshape(n, n),
            jitter_s=float(data.get("timing_jitter_s", 0.0)),
            varying={str(k): float(v) for k, v in data.get("varying_by_recording", {}).items()},
            extra=dict(data.get("extra", {})),
        )
        expected = model.structure.names
        given = tuple(p["name"] for p in data["parameters"])
        if given != expected:
            raise ValueError(
                f"its parameters are {', '.join(given)}, its terms need {', '.join(expected)}"
            )
        if unknown := set(model.varying) - set(expected):
            raise ValueError(
                f"varying_by_recording contains {', '.join(sorted(unknown))}, not a parameter"
            )
        if model.noise.shape != (3,) or not np.isfinite(model.values).all():
            raise ValueError("a parameter or the noise holds null where a number belongs")
        return model


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


def _check_terms(names: Sequence[str], written_with: Mapping[str, Any]) -> None:
    """Raise UsageError for an effect that is not installed; ``written_with``: effect → plug-in."""
    for name in names:
        try:
            term(name)
        except UsageError as error:
            for effect, about in written_with.items():
                if name in (effect, f"{effect}.{name.rpartition('.')[2]}"):
                    plug_in = PlugIn(**about)
                    raise UsageError(
                        f"Its effect {name!r} is of {plug_in}, which does not load here.",
                        cause=error.cause if broken() else "the package is not installed here.",
                        fix=plug_in.install,
                    ) from error
            raise
