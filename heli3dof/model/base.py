"""`Model`, the interface of every kind of model, and the closed-loop task that a model simulates.

Comparison, validation and diagnosis use these methods only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import ControllerSpec, Limits

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False)
class LoopTask:
    """The input of a closed-loop simulation: N control periods of length ``dt``."""

    reference: np.ndarray
    """(N, 3) rad, before the rate limiter; NaN counts as zero."""
    extra: np.ndarray
    """(N, 2) V added to the controller's output; NaN counts as zero."""
    angle0: np.ndarray
    """(3,) rad, the angles at rest at the start."""
    controller: ControllerSpec
    V_o: float
    """V, the controller's hover voltage (of the profile, not of the model)."""
    v_max: float
    """V"""
    dt: float
    """s"""
    rad_per_count: np.ndarray | None = None
    """(3,) rad per count of quantised encoders; None for ideal ones."""
    opened: np.ndarray | None = None
    """(N, 3) modes of the axes' loops (`model.control.loop_opening`); None: all closed."""
    limits: Limits = field(default_factory=Limits)
    """The envelope; an open loop is closed again when the rig nears it."""


@dataclass(frozen=True, eq=False)
class LoopResult:
    """The result of a closed-loop simulation: arrays over the task's N samples."""

    t: np.ndarray
    """(N,) s"""
    angle: np.ndarray
    """(N, 3) rad, the model's angles (not quantised)."""
    voltage: np.ndarray
    """(N, 2) V, after the limiter."""
    voltage_cmd: np.ndarray
    """(N, 2) V, before it."""
    reference_limited: np.ndarray | None = None
    """(N, 3) rad, the reference after its rate limiter."""
    reference: np.ndarray | None = None
    """(N, 3) rad as applied, if loops were opened; None: the task's."""
    extra: np.ndarray | None = None
    """(N, 2) V as applied, likewise."""


class Model(Protocol):
    """A simulation of the rig."""

    @property
    def name(self) -> str:
        """The name shown in tables and figures."""
        ...

    @property
    def kind(self) -> str:
        """``hover``, ``hover_printed``, ``statespace``, ``tf4``, ``oe``, ``paper17`` …"""
        ...

    def fly(self, task: LoopTask) -> LoopResult:
        """Simulate the closed loop. A diverging loop gives inf or NaN, not an exception."""
        ...

    def loop_poles(self, controller: ControllerSpec, dt: float) -> np.ndarray:
        """Continuous-time closed-loop poles (rad/s, complex) with the controller's gain."""
        ...

    def predict(self, recording: Recording, horizon_s: float) -> np.ndarray:
        """(N, 3) rad: row k is the prediction of ``angle[k]`` made ``horizon_s`` earlier.

        Uses all voltages before row k and the angles up to the horizon before it. NaN in the
        first rows and on an axis that is not modelled.
        """
        ...

    def to_control(self, *, in_continuous_time: bool = False) -> control.StateSpace:
        """The model about its trim, for python-control; nonlinear models at level hover."""
        ...

    def to_dict(self) -> Mapping[str, Any]:
        """The content of the model file; see `heli3dof.model.model_file`."""
        ...
