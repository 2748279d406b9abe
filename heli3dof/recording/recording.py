"""`Recording`: the one type that flows from reader to report.

Sample k's voltage follows from sample k's angles and is held until sample k+1. So
``voltage[k]`` acts on the plant between ``t[k]`` and ``t[k+1]``, and ``angle[k]`` was measured
before it acted. SI throughout: s, V, rad.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.rig.profile import Profile


@dataclass(frozen=True, eq=False)
class Recording:
    """A flight: arrays over N samples, the rig's profile, and where it came from.

    Columns that were not logged are NaN throughout; ``has`` and ``axes`` tell which are there.
    """

    t: np.ndarray
    """(N,) s, strictly increasing, on the clock that timed the samples."""
    voltage: np.ndarray
    """(N, 2) V, front and back, what reached the motors' amplifier after its limiter."""
    angle: np.ndarray
    """(N, 3) rad, roll, pitch, yaw, from the encoders."""
    reference: np.ndarray
    """(N, 3) rad, what was asked for, before the reference rate limiter."""
    voltage_cmd: np.ndarray
    """(N, 2) V, what the controller asked for, before the limiter."""
    voltage_extra: np.ndarray
    """(N, 2) V, what the experiment added to the controller's output."""
    profile: Profile
    channels: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Further (N,) columns by their name with unit: counts, flags, lateness, unknown columns."""
    meta: Mapping[str, Any] = field(default_factory=dict)
    """Provenance (JSON-able): name, source, plan, seed, versions, hashes, outcome."""

    def __post_init__(self) -> None:
        n = self.t.shape[0]
        shapes = {
            "voltage": (n, 2),
            "angle": (n, 3),
            "reference": (n, 3),
            "voltage_cmd": (n, 2),
            "voltage_extra": (n, 2),
        }
        for name, shape in shapes.items():
            got = getattr(self, name).shape
            if got != shape:
                raise ValueError(f"Recording.{name} has shape {got}, not {shape}")

    def __len__(self) -> int:
        return int(self.t.shape[0])

    @property
    def name(self) -> str:
        return str(self.meta.get("name", "recording"))

    @property
    def dt(self) -> float:
        """The median sample interval in seconds."""
        return float(np.median(np.diff(self.t)))

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample."""
        return float(self.t[-1] - self.t[0])

    @property
    def axes(self) -> tuple[str, ...]:
        """The angles that were measured, in the order roll, pitch, yaw."""
        return tuple(a for i, a in enumerate(AXES) if not np.isnan(self.angle[:, i]).all())

    def has_reference(self, axis: str) -> bool:
        return not bool(np.isnan(self.reference[:, AXES.index(axis)]).all())

    @property
    def has_cmd(self) -> bool:
        """True when the voltage before the limiter was logged."""
        return not bool(np.isnan(self.voltage_cmd).all())

    @property
    def digest(self) -> str:
        """SHA-256 over time, voltages and angles, to 1e-9: the same flight in any format.

        (Degrees in a CSV move the last bits of an angle; those must not make another flight.)
        """
        h = hashlib.sha256()
        for a in (self.t, self.voltage, self.angle):
            h.update((np.round(a, 9) + 0.0).astype("<f8").tobytes())
        return h.hexdigest()

    def between(self, start_s: float, stop_s: float) -> Recording:
        """The samples with start_s ≤ t < stop_s, with the same profile and provenance."""
        keep = (self.t >= start_s) & (self.t < stop_s)
        return self.rows(keep)

    def rows(self, keep: np.ndarray | slice) -> Recording:
        """The rows picked by a mask or a slice."""
        return replace(
            self,
            t=self.t[keep],
            voltage=self.voltage[keep],
            angle=self.angle[keep],
            reference=self.reference[keep],
            voltage_cmd=self.voltage_cmd[keep],
            voltage_extra=self.voltage_extra[keep],
            channels={k: v[keep] for k, v in self.channels.items()},
        )


def make_recording(
    t: np.ndarray,
    voltage: np.ndarray,
    angle: np.ndarray,
    profile: Profile,
    *,
    reference: np.ndarray | None = None,
    voltage_cmd: np.ndarray | None = None,
    voltage_extra: np.ndarray | None = None,
    channels: Mapping[str, np.ndarray] | None = None,
    meta: Mapping[str, Any] | None = None,
) -> Recording:
    """A `Recording` from arrays; what is not given becomes a column of NaN."""
    n = len(t)

    def fill(a: np.ndarray | None, columns: int) -> np.ndarray:
        return np.full((n, columns), np.nan) if a is None else np.asarray(a, dtype=float)

    return Recording(
        t=np.asarray(t, dtype=float),
        voltage=np.asarray(voltage, dtype=float),
        angle=np.asarray(angle, dtype=float),
        reference=fill(reference, 3),
        voltage_cmd=fill(voltage_cmd, 2),
        voltage_extra=fill(voltage_extra, 2),
        profile=profile,
        channels=dict(channels or {}),
        meta=dict(meta or {}),
    )
