"""`Recording`: the arrays of one flight, its profile and its provenance.

The controller computes sample k's voltage from sample k's angles and holds it until sample k+1. So
``voltage[k]`` acts on the plant between ``t[k]`` and ``t[k+1]``, and ``angle[k]`` was measured
before this interval. Units are SI: s, V, rad.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from heli3dof.arrays import BoolArray, FloatArray, IndexArray
from heli3dof.axes import AXES
from heli3dof.errors import RecordingError, UsageError, listed
from heli3dof.recording.columns import ARRAYS, export_columns, unit_of
from heli3dof.recording.linear_controller import LinearController
from heli3dof.results import Result, optional
from heli3dof.rig.profile import ControllerSpec, Profile

if TYPE_CHECKING:
    import pandas
    import xarray

LISTED = 8
"""Largest number of channel names in a recording's repr; further channels are only counted."""


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Result):
    """A flight: arrays over N samples, the rig's profile and the provenance.

    All arrays are read-only, so that no calculation changes a recording. To change an array, copy
    it (``angle = r.angle.copy()``), and make a new recording with `make_recording`. Columns that
    were not logged contain only NaN. ``axes`` lists the axes whose angles were logged.
    ``has_reference(axis)`` is True if the reference of an axis was logged. ``has_cmd`` is True if
    the voltages before the limiter were logged.
    """

    t: FloatArray
    """(N,) s, sampling times from the device's clock or the log; increasing, if the clock works."""
    voltage: FloatArray
    """(N, 2) V, front and back motor, at the amplifier, after the limiter."""
    angle: FloatArray
    """(N, 3) rad, roll, pitch, yaw, from the encoders."""
    reference: FloatArray
    """(N, 3) rad, references of roll, pitch, yaw, before the reference rate limiter."""
    voltage_cmd: FloatArray
    """(N, 2) V, front and back, the controller's output before the limiter."""
    voltage_extra: FloatArray
    """(N, 2) V, front and back, voltage that the experiment added to the controller's output."""
    profile: Profile
    channels: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Further columns (N,) by name with unit: counts, flags, lateness, unknown columns of a log."""
    meta: Mapping[str, Any] = field(default_factory=dict)
    """Provenance (JSON-able): name, source, plan, seed, versions, hashes, outcome."""
    identified_controller: LinearController | None = None
    """Controller identified from this recording; replaces the profile's. No file contains it."""
    start_s: float | None = None
    """s, in a part of a recording: the time of the whole recording's first sample. None: t[0]."""

    def __post_init__(self) -> None:
        self._own_arrays()
        n = self.t.size
        shapes = {"t": (n,), **{array: (n, len(names)) for array, names in ARRAYS.items()}}
        checked = [(name, getattr(self, name).shape, shape) for name, shape in shapes.items()]
        checked += [(f"channels[{k!r}]", np.shape(v), (n,)) for k, v in self.channels.items()]
        for name, got, shape in checked:
            if got != shape:
                raise UsageError(
                    f"{name} has the shape {got}, not {shape}.",
                    cause="a transposed array, or signals of different lengths.",
                    fix="pass arrays with one row per sample",
                )

    def _own_arrays(self) -> None:
        """Make all arrays read-only, and copy what the caller may still change.

        These are writable arrays, ``channels`` and ``meta``.
        """
        for name in ("t", *ARRAYS):
            object.__setattr__(self, name, _read_only(getattr(self, name)))
        channels = {name: _read_only(signal) for name, signal in self.channels.items()}
        object.__setattr__(self, "channels", channels)
        object.__setattr__(self, "meta", deepcopy(dict(self.meta)))

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore a pickled or copied recording; pickle itself would make its arrays writable."""
        self.__dict__.update(state)
        self._own_arrays()

    def summary(self) -> str:
        """Return three lines of text: the recording's size and outcome, axes, channels."""
        rate = f"{self.duration:.1f} s at {1 / self.dt:.6g} Hz" if len(self) > 1 else "no duration"
        outcome = self.meta.get("outcome", "completed")
        ended = "" if outcome == "completed" else f"; the flight's outcome: {outcome}"
        references = [a for a in self.axes if self.has_reference(a)]
        known = "" if self.profile.controller_is_known else ", controller unknown"
        names = sorted(self.channels)
        return (
            f"Recording {self.name!r}: {len(self)} samples, {rate}{ended}\n"
            f"  axes: {', '.join(self.axes) or 'none'}; references: "
            f"{', '.join(references) or 'none'}; profile: {self.profile.name}{known}\n"
            f"  channels: {listed(names, LISTED) or 'none'}"
        )

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a pandas data frame with index ``t_s``, angles in degrees.

        The columns are those of docs/reference/recording.md, and the further signals in
        ``channels``. Columns that were not logged are absent. Raises UsageError if pandas is
        missing.
        """
        pd = optional("pandas")
        columns = export_columns(self)
        frame = pd.DataFrame(columns, index=pd.Index(columns.pop("t_s"), name="t_s"))
        frame.attrs["name"] = self.name
        return frame

    def to_xarray(self) -> xarray.Dataset:
        """Return an xarray data set over ``t_s``: the columns of `to_dataframe` with their units.

        The arrays are copies. Raises UsageError if xarray is missing.
        """
        xr = optional("xarray")
        columns = export_columns(self)
        t_s = columns.pop("t_s")
        data = {name: ("t_s", v.copy(), {"units": unit_of(name)}) for name, v in columns.items()}
        about = {"name": self.name, "profile": self.profile.name, "digest": self.digest}
        return xr.Dataset(data, coords={"t_s": ("t_s", t_s.copy(), {"units": "s"})}, attrs=about)

    def __len__(self) -> int:
        return int(self.t.shape[0])

    @property
    def name(self) -> str:
        return str(self.meta.get("name", "recording"))

    @property
    def dt(self) -> float:
        """Return the median sample interval in s; NaN for fewer than two samples."""
        return float(np.median(np.diff(self.t))) if len(self) > 1 else math.nan

    @property
    def duration(self) -> float:
        """Return the time from the first to the last sample in s; 0 without samples."""
        return float(self.t[-1] - self.t[0]) if len(self) else 0.0

    @property
    def elapsed_s(self) -> FloatArray:
        """Return the times (N,) in s since the first sample of the recording.

        In a part of a recording, they count from the first sample of the whole recording.
        """
        return self.t - (self.t[:1] if self.start_s is None else self.start_s)

    @property
    def axes(self) -> tuple[str, ...]:
        """Return the axes whose angles were measured, in the order roll, pitch, yaw."""
        return tuple(a for i, a in enumerate(AXES) if not np.isnan(self.angle[:, i]).all())

    def has_reference(self, axis: str) -> bool:
        """Return True if the reference of ``axis`` was logged.

        Raises UsageError for an unknown axis.
        """
        if axis not in AXES:
            raise UsageError(
                f"There is no axis {axis!r}.",
                cause="the paper calls roll elevation, pitch tilt and yaw travel.",
                fix=f"one of {', '.join(AXES)}",
            )
        return not bool(np.isnan(self.reference[:, AXES.index(axis)]).all())

    @property
    def controller(self) -> ControllerSpec | LinearController | None:
        """Return the identified controller, else the profile's; None if neither exists."""
        return self.identified_controller or self.profile.controller

    @property
    def controller_input(self) -> FloatArray:
        """Return the voltages (N, 2) in V to add to the controller's output in a simulation.

        Column 0 is the front motor, column 1 the back motor. For the profile's controller, these
        voltages are ``voltage_extra``, which the experiment added. For an identified controller,
        they are the input w of `LinearController`. w is the recorded voltage minus the voltage that
        the identified law computes from angles and earlier voltages. So w includes the effects of
        references and excitation, and the error of the law.
        """
        if self.identified_controller is None:
            return self.voltage_extra
        return self.identified_controller.input_of(self.voltage, self.angle)

    @property
    def has_cmd(self) -> bool:
        """Return True if the voltage before the limiter was logged."""
        return not bool(np.isnan(self.voltage_cmd).all())

    @property
    def digest(self) -> str:
        """Return the SHA-256 of time, voltages and angles rounded to 1e-9 (s, V, rad).

        Because of the rounding, exporting and importing does not change the digest, even if a CSV
        in degrees changes the last bits of an angle.
        """
        h = hashlib.sha256()
        for a in (self.t, self.voltage, self.angle):
            h.update(rounded(a).astype("<f8").tobytes())
        return h.hexdigest()

    def between(self, start_s: float, stop_s: float) -> Recording:
        """Return the part of the recording with start_s ≤ t < stop_s; profile and meta are kept.

        Raises UsageError if no sample lies there.
        """
        try:
            start, stop = float(start_s), float(stop_s)
        except (TypeError, ValueError):
            start = stop = math.nan
        keep = (self.t >= start) & (self.t < stop)
        if not keep.any():
            covered = f"t = {self.t[0]:.6g} s to {self.t[-1]:.6g} s" if len(self) else "no time"
            raise UsageError(
                f"{self.name} has no samples between {start_s!r} s and {stop_s!r} s.",
                cause="the first time is not less than the second, or the part lies outside; the "
                f"recording covers {covered}.",
                fix="recording.between(first time, later time), both in s as in recording.t",
            )
        return self.rows(keep)

    def rows(self, keep: BoolArray | IndexArray | slice) -> Recording:
        """Return a recording of the samples that a mask (N,), an index array or a slice selects.

        Raises UsageError if ``keep`` selects no samples, or samples that do not exist.
        """
        try:
            selected = np.atleast_1d(np.arange(len(self))[keep])
        except (IndexError, TypeError, ValueError) as error:
            selected = np.zeros(0, dtype=int)
            cause = f"{error}."
        else:
            cause = "the part lies outside of the recording, or the mask is False throughout."
        if selected.ndim != 1 or not selected.size:
            raise UsageError(
                f"The selection contains none of the {len(self)} samples of {self.name}.",
                cause=cause,
                fix="rows(slice(0, 1000)), or rows(recording.t > 5)",
            )
        arrays: dict[str, Any] = {name: getattr(self, name)[keep] for name in ("t", *ARRAYS)}
        return replace(
            self,
            **arrays,
            channels={k: v[keep] for k, v in self.channels.items()},
            start_s=self.t[0] if self.start_s is None and len(self) else self.start_s,
        )


def check_samples(recording: Recording, argument: str = "recording") -> None:
    """Raise RecordingError if a recording has no samples; the message names the ``argument``."""
    if not len(recording):
        raise RecordingError(
            f"{argument}: the recording {recording.name!r} has no samples.",
            cause="the flight ended before its first control period, or the arrays are empty.",
            fix="give another flight; recording.summary() states the number of samples",
        )


def _read_only(values: np.ndarray) -> np.ndarray:
    """Return a read-only copy of a writable array; a read-only array is returned unchanged."""
    if not values.flags.writeable:
        return values
    own = values.copy()
    own.flags.writeable = False
    return own


def rounded(values: FloatArray) -> FloatArray:
    """Return ``values`` rounded to 1e-9 without negative zeros, to compare samples of two files."""
    return np.round(values, 9) + 0.0


def output_voltage(reported: np.ndarray, sent: np.ndarray) -> np.ndarray:
    """Return the output voltages (N, 2) V: those ``reported`` by the device, or else ``sent``.

    A device that reports no voltages has NaN in every row of ``reported``.
    """
    return sent if np.isnan(reported).all() else reported


def recording_of_arrays(
    t: ArrayLike,
    voltage: ArrayLike,
    angle: ArrayLike,
    profile: Profile,
    *,
    reference: ArrayLike | None = None,
    voltage_cmd: ArrayLike | None = None,
    voltage_extra: ArrayLike | None = None,
    channels: Mapping[str, np.ndarray] | None = None,
    meta: Mapping[str, Any] | None = None,
) -> Recording:
    """Return a `Recording` made of arrays; omitted references and voltages become columns of NaN.

    Only shapes are checked; `heli3dof.recording.logs.from_arrays` also checks the values. The
    arguments are the fields of `Recording`.
    """
    times = _floats("t", t)
    n = len(times) if times.ndim else 0

    def fill(name: str, a: ArrayLike | None, columns: int) -> FloatArray:
        return np.full((n, columns), np.nan) if a is None else _floats(name, a)

    return Recording(
        t=times,
        voltage=_floats("voltage", voltage),
        angle=_floats("angle", angle),
        reference=fill("reference", reference, 3),
        voltage_cmd=fill("voltage_cmd", voltage_cmd, 2),
        voltage_extra=fill("voltage_extra", voltage_extra, 2),
        profile=profile,
        channels={k: np.asarray(_without_mask(v)) for k, v in (channels or {}).items()},
        meta=dict(meta or {}),
    )


def _without_mask(values: ArrayLike) -> ArrayLike:
    """Return ``values``; a numpy masked array becomes floats, with NaN where it is masked."""
    if not isinstance(values, np.ma.MaskedArray):
        return values
    filled: np.ndarray = np.ma.filled(values.astype(float), np.nan)
    return filled


def _floats(name: str, values: ArrayLike) -> FloatArray:
    """Return ``values`` as an array of floats; raise UsageError unless they are real numbers.

    The error names the argument ``name``.
    """
    try:
        if np.iscomplexobj(values):
            raise TypeError("complex numbers")
        return np.asarray(_without_mask(values), dtype=float)
    except (TypeError, ValueError) as error:
        raise UsageError(
            f"{name} is not an array of real numbers: {error}.",
            cause="text, complex numbers, or rows of different lengths.",
            fix="pass arrays with one row per sample",
        ) from None
