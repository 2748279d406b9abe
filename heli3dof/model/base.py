"""What every model can do, whatever its kind: replay the loop, and predict from data so far.

Comparison, validation and diagnosis only ask these questions; a new kind of model answers them
in one new file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import ControllerSpec, Limits


@dataclass(frozen=True, eq=False)
class LoopTask:
    """What a closed loop is asked to fly: N control periods of length ``dt``."""

    reference: np.ndarray
    """(N, 3) rad, before the rate limiter; NaN is taken as zero."""
    extra: np.ndarray
    """(N, 2) V added to the controller's output; NaN is taken as zero."""
    angle0: np.ndarray
    """(3,) rad, the angles at the start, at rest."""
    controller: ControllerSpec
    V_o: float
    """V, the hover voltage that the controller adds (the profile's, not the model's)."""
    v_max: float
    """V"""
    dt: float
    """s"""
    rad_per_count: np.ndarray | None = None
    """(3,) rad per count: the controller sees quantised angles; None for ideal encoders."""
    opened: np.ndarray | None = None
    """(N, 3) modes of the axes' loops, see `model.control.loop_opening`; None: all stay closed."""
    limits: Limits = field(default_factory=Limits)
    """Where an opened loop is handed back to the controller."""


@dataclass(frozen=True, eq=False)
class LoopResult:
    """What the loop did: arrays over the same N samples as the task."""

    t: np.ndarray
    """(N,) s"""
    angle: np.ndarray
    """(N, 3) rad, the model's angles (not quantised)."""
    voltage: np.ndarray
    """(N, 2) V, after the limiter."""
    voltage_cmd: np.ndarray
    """(N, 2) V, before it."""
    reference_limited: np.ndarray | None = None
    """(N, 3) rad, the reference behind its rate limiter, where the simulation kept it."""
    reference: np.ndarray | None = None
    """(N, 3) rad as flown, where loops were opened; None: the task's."""
    extra: np.ndarray | None = None
    """(N, 2) V as flown, likewise."""


class Model(Protocol):
    """A simulation of the rig."""

    @property
    def name(self) -> str: ...

    @property
    def kind(self) -> str:
        """``hover``, ``hover_printed``, ``statespace``, ``tf4``, ``oe``, ``paper17`` …"""
        ...

    def fly(self, task: LoopTask) -> LoopResult:
        """The closed loop on this model. Diverging loops give inf/NaN, not an exception."""
        ...

    def loop_poles(self, controller: ControllerSpec, dt: float) -> np.ndarray:
        """Continuous-time poles (rad/s, complex) of this model in the loop with the gain."""
        ...

    def predict(self, recording: Recording, horizon_s: float) -> np.ndarray:
        """(N, 3) rad: row k is the prediction of ``angle[k]`` made ``horizon_s`` earlier.

        Uses the voltages throughout and the angles up to k − horizon only; NaN where there is
        no prediction yet or the axis is not modelled.
        """
        ...

    def to_dict(self) -> Mapping[str, Any]:
        """The model file's content; see ``heli3dof.model.model_file``."""
        ...
