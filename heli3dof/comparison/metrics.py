"""Compute step metrics per axis: peak, overshoot, steady error, rise and settling time.

A *segment* is a time in which the reference is constant. After the first one, only segments of
`MIN_HOLD_S` or more count. With the measured angle y, the set value y_r and the start value y_a
(degrees), and s = sgn(y_r − y_a):

    peak               y_pk, with s·y_pk = max s·y
    overshoot          s·(y_pk − y_r)                   (negative if y does not reach y_r)
    overshoot, percent 100 · overshoot / |y_r − y_a|
    steady error       mean of y − y_r over the last tenth of the segment
    rise time          from y_a + 10 % to y_a + 90 % of (y_r − y_a), interpolated
    settling time      from the step until y stays within ±2 % of |y_r − y_a| about y_r

The paper's word "overshoot" has two meanings (erratum E10). Its section II-C defines overshoot as
the largest difference from the set value. Its section III and Table II print peak values instead.
Here the two are ``overshoot_deg`` and ``peak_deg``.

Kinds of segment:

``step``     the reference changes at its start; y_a is the previous set value. If a rate limiter
             makes the change a ramp, the segment starts where the ramp starts.
``start``    the first segment, if the angle starts more than `MIN_STEP_DEG` from its set value; y_a
             is the first angle.
``hold``     the first segment, if the angle starts at its set value. The peak is the angle farthest
             from the set value and the overshoot its distance (≥ 0). Percent, rise and settling
             time are undefined.
``moving``   the whole reference, if over half of its rows are in constant parts shorter than
             `MIN_HOLD_S` (a ramp, a multisine). The peak is the angle of the largest modulus; the
             other metrics are undefined.
``none``     there is no reference, and every metric is undefined.

A segment after rows without a reference counts as a first segment.

A ``hold`` or ``moving`` segment begins at the first change of any axis' reference after the
take-off (`heli3dof.identification.row_selection`), unless the segment ends before this change.

The *reported* segment of an axis is its first ``step``, else its ``start``, else the ``hold`` or
``moving`` segment.
``AxisMetrics.steps`` has all segments. Undefined metrics are NaN.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from heli3dof.arrays import BoolArray, FloatArray, IndexArray
from heli3dof.axes import AXES
from heli3dof.identification.row_selection import unusable
from heli3dof.model.control.loop_task import under_control
from heli3dof.recording.recording import Recording

Kind = Literal["step", "start", "hold", "moving", "none"]

MIN_STEP_DEG = 0.5
"""Degrees: a first segment whose first angle is at most this far from its set value has the kind
``hold``, otherwise ``start`` (a convention)."""
MIN_HOLD_S = 0.5
"""s: a reference counts as moving if less than half of its rows are in constant stretches of at
least this length (a convention)."""
SETTLING_BAND = 0.02
"""Half-width of the settling band as a share of the step's size (a convention)"""
STEADY_SHARE = 0.1
"""Share of a segment, at its end, over which the steady error is averaged (a convention)"""

METRICS = (
    "peak_deg",
    "overshoot_deg",
    "overshoot_percent",
    "steady_error_deg",
    "rise_time_s",
    "settling_time_s",
)


@dataclass(frozen=True)
class StepMetrics:
    """Step metrics of one axis in one segment of its reference, as the module defines them."""

    kind: Kind
    start_s: float
    """s on the recording's clock: the segment's start, from which the settling time counts"""
    stop_s: float
    from_deg: float
    """Start value y_a of the segment, degrees"""
    set_deg: float
    """Set value y_r of the segment, degrees; NaN for a moving reference"""
    peak_deg: float = np.nan
    overshoot_deg: float = np.nan
    overshoot_percent: float = np.nan
    steady_error_deg: float = np.nan
    rise_time_s: float = np.nan
    settling_time_s: float = np.nan

    def values(self) -> dict[str, float]:
        """Return the six metrics as name → value (NaN: undefined), in the order of `METRICS`."""
        return {name: float(getattr(self, name)) for name in METRICS}


@dataclass(frozen=True)
class AxisMetrics:
    """Step metrics of one axis."""

    reported: StepMetrics
    """Metrics of the segment that tables show: the first step, if the reference has one"""
    steps: tuple[StepMetrics, ...]
    """Metrics of every segment of the reference"""


@dataclass(frozen=True)
class _Segment:
    kind: Kind
    rows: slice
    from_deg: float
    set_deg: float


NOTHING = StepMetrics("none", np.nan, np.nan, np.nan, np.nan)


def flight_metrics(recording: Recording) -> Mapping[str, AxisMetrics]:
    """Return {axis: step metrics of the measured angle} of a recording.

    The ramp of the voltages to zero at the end of the flight is left out.
    """
    flown = under_control(recording)
    return metrics_in_flight(flown, flown.angle)


def metrics_in_flight(flown: Recording, angle: FloatArray) -> Mapping[str, AxisMetrics]:
    """Return {axis: step metrics} of ``angle`` (N, 3) rad, for the references in ``flown``.

    ``flown`` is a recording under closed-loop control. ``angle`` contains measured or simulated
    angles at the times of ``flown``. The end of the take-off is found in the angles of ``flown``,
    even if ``angle`` is simulated.
    """
    since_s = -np.inf
    if len(flown) > 1:
        rows = unusable(flown)
        since_s = float(flown.t[np.argmin(rows["table"] | rows["take_off"])])
    resolution = flown.profile.encoder.rad_per_count
    return step_metrics(flown.t, angle, flown.reference, resolution=resolution, since_s=since_s)


def step_metrics(
    t: FloatArray,
    angle: FloatArray,
    reference: FloatArray,
    *,
    resolution: FloatArray | None = None,
    since_s: float = -np.inf,
) -> Mapping[str, AxisMetrics]:
    """Return {axis: step metrics} of measured or simulated angles.

    ``t`` (N,) in s; ``angle`` (N, 3) in rad; ``reference`` (N, 3) in rad, before the rate limiter,
    NaN where there is none. ``resolution`` (3,) rad, the angle of one encoder count, is the least
    half-width of the settling band. ``since_s``: the end of the take-off, s.
    """
    changes = np.concatenate([_changes(reference[:, i]) for i in range(len(AXES))])
    since_s = min((x for x in t[changes] if x >= since_s), default=max(t[0], since_s))
    count = np.zeros(len(AXES)) if resolution is None else np.abs(resolution)
    return {
        axis: axis_metrics(
            t, angle[:, i], reference[:, i], since_s=float(since_s), resolution=float(count[i])
        )
        for i, axis in enumerate(AXES)
    }


def axis_metrics(
    t: FloatArray,
    angle: FloatArray,
    reference: FloatArray,
    *,
    since_s: float = -np.inf,
    resolution: float = 0.0,
) -> AxisMetrics:
    """Return the step metrics of one axis: t (N,) s, angle (N,) rad, reference (N,) rad.

    A segment is a part of the reference, for example from one step to the next. The result has the
    metrics of every segment, and separately those of one reported segment. The reported segment is
    the first one of this list that exists:

    * the first step of the reference
    * the approach to the first set value, if the angle does not start at this value
    * the first segment

    Of a segment of the kind ``hold`` or ``moving``, the metrics use only the rows from the time
    ``since_s`` (s) on. ``resolution`` (rad): the least half-width of the settling band.
    """
    y, ref = np.degrees(angle), np.degrees(reference)

    def without_early_rows(s: _Segment) -> _Segment:
        """Return a segment without its rows before ``since_s``, unless all rows are earlier."""
        first = max(s.rows.start, int(np.searchsorted(t, since_s)))
        return replace(s, rows=slice(first, s.rows.stop)) if first < s.rows.stop else s

    segments = [
        without_early_rows(s) if s.kind in ("hold", "moving") else s for s in _segments(t, y, ref)
    ]
    steps = tuple(_measure(t, y, ref, s, np.degrees(resolution)) for s in segments)
    for kind in ("step", "start"):
        for step in steps:
            if step.kind == kind:
                return AxisMetrics(step, steps)
    return AxisMetrics(steps[0] if steps else NOTHING, steps)


def _changes(reference: FloatArray) -> IndexArray:
    """Return the indices at which the value of ``reference`` changes, also to or from NaN."""
    absent = np.isnan(reference)
    with np.errstate(invalid="ignore"):
        moved = np.abs(np.diff(reference)) > 1e-9
    return np.flatnonzero(moved | (absent[1:] != absent[:-1])) + 1


def _segments(t: FloatArray, y: FloatArray, ref: FloatArray) -> list[_Segment]:
    """Return the segments of a reference ``ref``; t (N,) in s, ``ref`` and angle y (N,) in °."""
    known = np.flatnonzero(~np.isnan(ref))
    if not len(known):
        return []
    rows = slice(int(known[0]), int(known[-1]) + 1)
    edges = [rows.start, *(int(c) for c in _changes(ref) if rows.start < c < rows.stop), rows.stop]
    stretches = [slice(a, b) for a, b in itertools.pairwise(edges) if not np.isnan(ref[a])]
    long = [s for s in stretches if t[s.stop - 1] - t[s.start] >= MIN_HOLD_S]
    if len(stretches) > 1 and sum(s.stop - s.start for s in long) < 0.5 * len(known):
        return [_Segment("moving", rows, float(y[rows.start]), np.nan)]
    segments: list[_Segment] = []
    ramp, direction = rows.start, 0.0  # the row from which the reference moves in this direction
    for s in stretches:
        set_deg, start = float(ref[s.start]), float(y[s.start])
        previous = np.nan if s.start == rows.start else float(ref[s.start - 1])
        if np.isnan(previous):
            kind: Kind = "start" if abs(set_deg - start) > MIN_STEP_DEG else "hold"
            segments.append(_Segment(kind, s, start, set_deg))
            direction = 0.0
            continue
        if np.sign(set_deg - previous) != direction:
            ramp, direction = s.start, float(np.sign(set_deg - previous))
        if s in long:
            segments.append(_Segment("step", slice(ramp, s.stop), float(ref[ramp - 1]), set_deg))
            direction = 0.0
    return segments


def _measure(
    t: FloatArray, y: FloatArray, ref: FloatArray, segment: _Segment, resolution_deg: float
) -> StepMetrics:
    """Return the step metrics of one segment; the arguments are those of `axis_metrics`, in °."""
    rows = segment.rows
    t, y, ref = t[rows], y[rows], ref[rows]
    base = StepMetrics(segment.kind, float(t[0]), float(t[-1]), segment.from_deg, segment.set_deg)
    if not np.isfinite(y).all():
        return base
    if segment.kind == "moving":
        return replace(base, peak_deg=float(y[np.argmax(np.abs(y))]))
    if segment.kind == "hold":
        far = int(np.argmax(np.abs(y - ref)))
        return replace(
            base,
            peak_deg=float(y[far]),
            overshoot_deg=float(abs(y[far] - ref[far])),
            steady_error_deg=_steady_error(t, y - ref),
        )
    size = segment.set_deg - segment.from_deg
    s = np.sign(size)
    peak = float(s * np.max(s * y))
    overshoot = float(s * (peak - segment.set_deg))
    progress = (y - segment.from_deg) / size
    outside = np.abs(y - segment.set_deg) > max(SETTLING_BAND * abs(size), resolution_deg)
    return replace(
        base,
        peak_deg=peak,
        overshoot_deg=overshoot,
        overshoot_percent=100 * overshoot / abs(size),
        steady_error_deg=_steady_error(t, y - segment.set_deg),
        rise_time_s=_crossing(t, progress, 0.9) - _crossing(t, progress, 0.1),
        settling_time_s=_settling(t, outside),
    )


def _steady_error(t: FloatArray, error: FloatArray) -> float:
    """Return the mean of ``error`` (N,) in degrees over the last tenth of the time t (N,) in s."""
    return float(np.mean(error[t >= t[-1] - STEADY_SHARE * (t[-1] - t[0])]))


def _crossing(t: FloatArray, progress: FloatArray, level: float) -> float:
    """Return the time (s) at which ``progress`` first rises through ``level``; NaN if never.

    ``progress`` (N,): the angle, 0 at the step's start and 1 at its set value. ``t`` (N,) in s.
    """
    above = progress >= level
    k = int(np.argmax(above))
    if not above[k] or k == 0:
        return np.nan
    share = (level - progress[k - 1]) / (progress[k] - progress[k - 1])
    return float(t[k - 1] + share * (t[k] - t[k - 1]))


def _settling(t: FloatArray, outside: BoolArray) -> float:
    """Return the time (s) after ``t[0]`` from which no row is ``outside``.

    It is NaN if the last row is outside. ``outside`` (N,): True where the angle is outside the
    settling band.
    """
    if outside[-1]:
        return np.nan
    last = np.flatnonzero(outside)
    return float(t[last[-1] + 1] - t[0]) if len(last) else 0.0
