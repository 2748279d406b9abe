"""`Model`: the interface of all models; `LoopTask`, `LoopResult`: a simulation's input and result.

Comparison, validation and diagnosis use a model only through the methods of `Model`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from heli3dof.arrays import ComplexArray, FloatArray
from heli3dof.errors import UsageError
from heli3dof.recording.linear_controller import LinearController
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import ControllerSpec, Limits, Profile

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False)
class LoopTask:
    """The input of a simulated closed-loop flight of N control periods of ``dt`` s each."""

    reference: FloatArray
    """(N, 3) rad, references before their rate limiter; NaN counts as zero."""
    extra: FloatArray
    """(N, 2) V, excitation added to the controller's output, or the input w of a linear
    controller (`recording.linear_controller`); NaN counts as zero."""
    angle0: FloatArray
    """(3,) rad, the angles at the start, where the rig is at rest."""
    controller: ControllerSpec | LinearController
    """The profile's controller, or a linear one identified from a log."""
    V_o: float
    """V, the hover voltage that the controller adds; the profile's, not the model's."""
    v_max: float
    """V, the amplifier's limit: |voltage| ≤ v_max."""
    dt: float
    """s, the control period."""
    rad_per_count: FloatArray | None = None
    """(3,) rad, the steps of quantised encoders; None: ideal encoders."""
    start_s: float = 0.0
    """s, the time of the first period since the start of the recording."""
    opened: FloatArray | None = None
    """(N, 3), each axis' mode: 0 CLOSED, 1 LEARN, 2 OPEN (`controller`); None: all closed."""
    limits: Limits = field(default_factory=Limits)
    """The safety envelope. The simulation closes open loops near its limits (`controller`), and
    continues beyond them."""


@dataclass(frozen=True, eq=False)
class LoopResult:
    """The result of a simulated closed-loop flight: angles, voltages, references at N samples."""

    t: FloatArray
    """(N,) s, sampling instants."""
    angle: FloatArray
    """(N, 3) rad, the model's encoder readings, not quantised."""
    voltage: FloatArray
    """(N, 2) V, motor voltages after the limiter ±v_max."""
    voltage_cmd: FloatArray
    """(N, 2) V, the controller's voltages before the limiter."""
    reference: FloatArray | None = None
    """(N, 3) rad, the task's reference as changed for open loops; None: unchanged."""
    extra: FloatArray | None = None
    """(N, 2) V, the task's extra voltage as changed for open loops; None: unchanged."""


class Model(Protocol):
    """Interface of a rig model, which simulates closed loops and predicts recorded angles."""

    @property
    def name(self) -> str:
        """Return the model's name as shown in tables and figures."""
        ...

    @property
    def kind(self) -> str:
        """Return the kind of model as a word, such as ``hover``, ``tf4``, ``oe``, ``greybox``."""
        ...

    @property
    def profile(self) -> Profile | None:
        """Return the profile of the rig that the model describes; None if it is unknown."""
        ...

    def fly(self, task: LoopTask) -> LoopResult:
        """Return the closed-loop flight that ``task`` describes, simulated with this model.

        If the simulation diverges, the result contains inf or NaN.
        """
        ...

    def loop_poles(self, controller: ControllerSpec, dt: float) -> ComplexArray:
        """Return the closed-loop poles (rad/s) with ``controller``, whose period is ``dt`` s.

        The hover model's loop is continuous. The loops of all other models are sampled: a pole z is
        returned as s = log(z)/dt.
        """
        ...

    def predict(self, recording: Recording, horizon_s: float) -> FloatArray:
        """Return predicted angles (N, 3) rad; row k predicts ``angle[k]`` ``horizon_s`` s ahead.

        Row k uses the angles up to ``horizon_s`` s before it, and the voltages of all rows before
        k. The first rows, and axes that the model does not contain, are NaN. Raises UsageError
        unless ``horizon_s`` is positive.
        """
        ...

    def to_control(
        self, *, in_continuous_time: bool = False, dt: float | None = None
    ) -> control.StateSpace:
        """Return a python-control state-space model from motor voltages (V) to angles (rad).

        Voltages and angles are deviations from the trim, about which a nonlinear model is
        linearised. The result is in discrete time, with samples every ``dt`` s (None: every control
        period), unless ``in_continuous_time`` is true.
        """
        ...

    def to_dict(self) -> Mapping[str, Any]:
        """Return the model as a dict for its JSON model file; see `heli3dof.model.model_file`."""
        ...


def checked_time(seconds: float, name: str) -> float:
    """Return ``seconds`` unchanged if it is positive and finite; otherwise raise UsageError.

    ``name``: the name of the caller's argument, for the error message.
    """
    try:
        is_positive = 0 < seconds < float("inf")
    except TypeError:
        is_positive = False
    if not is_positive:
        raise UsageError(
            f"{name} is {seconds}; it must be positive.",
            cause="a wrong sign, 0, or another object than a number.",
            fix=f"{name} in seconds, above 0"
            + ("; or in_continuous_time=True" if name == "dt" else ""),
        )
    return seconds
