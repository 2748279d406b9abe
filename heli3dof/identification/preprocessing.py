"""Prepare recordings for a fit: check clocks, select rows, set held-out data aside, decimate.

The amplifier holds the voltage V[k] from the time t[k] of sample k until t[k+1]. Decimation
combines q samples into one row. Row i has the mean voltage ū[i] and the angles y[i]. ū[i] is
*exactly* the integral of the voltage over the time of these samples, divided by this time:

    ū[i] = Σ_{j=iq}^{iq+q−1} V[j] (t[j+1] − t[j]) / (t[(i+1)q] − t[iq]),      y[i] = angle[iq]

The angles are sampled, not averaged. An average would include angles after t[iq], which already
respond to ū[i].

A segment is a part of a recording without interruption. It ends at a long gap in the clock, and at
a row that a linear model cannot use (`heli3dof.identification.row_selection`). A short gap ends no
segment: the voltage was held, so its integral is known, and missing angles are interpolated
linearly. During a gap of g seconds with the angular acceleration α, the interpolation error is at
most |α| g²/8. It is 0.01°, less than an encoder count, for 10 rad/s² and 13 ms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.errors import RecordingError, quoted
from heli3dof.identification.row_selection import REASONS, TAKE_OFF_S, clipped, runs_of, unusable
from heli3dof.model.estimation.filter_data import LOST, RowRange
from heli3dof.recording.gap_filling import fill_gaps
from heli3dof.recording.logs.log_validation import (
    Timing,
    check_time_increases,
    timing,
)
from heli3dof.recording.recording import Recording
from heli3dof.recording.safety_trip import why_short

MIN_SAMPLES = 3
"""Smallest number of samples for which the scatter of the sample interval can be computed"""
SEGMENT_MIN_S = 1.0
USABLE_MIN_S = 5.0
LEFT_OUT = {
    "unread": "without a reading",
    "table": "on the table",
    "take_off": f"of the climb (at least {TAKE_OFF_S:g} s after lift-off)",
    "stop": "at a stop",
    "motors_off": "with the motors off",
    "falling": "of falling",
    "ramp_down": "of the ramp to zero",
    "other": f"held out for validation, or in pieces shorter than {SEGMENT_MIN_S:g} s",
}
"""Reason of `row_selection` → the rows that it leaves out, in words"""
HELD_OUT_SHARE = 0.25


@dataclass(frozen=True)
class RecordingReport:
    """Sampling statistics of one recording, and the shares of usable and of left-out rows.

    ``clipped_share``: usable rows at the amplifier's limit; ``segments``: number of usable runs.
    """

    name: str
    seconds: float
    timing: Timing
    control_period_s: float
    """s, from the rig's profile"""
    long_gaps: int
    """Number of gaps that are too long to be interpolated"""
    left_out: dict[str, float]
    """Reason for leaving rows out → share of rows. If a row has several, the first one counts."""
    usable_share: float
    clipped_share: float
    segments: int

    def to_json(self) -> dict[str, Any]:
        c = self.timing
        return {
            "recording": self.name,
            "duration_s": self.seconds,
            "period_s": c.period_s,
            "control_period_s": self.control_period_s,
            "jitter_s": c.jitter_s,
            "gaps": c.gaps,
            "long_gaps": self.long_gaps,
            "lost_share": c.lost_share,
            "usable_share": self.usable_share,
            "left_out_share": self.left_out,
            "clipped_share": self.clipped_share,
            "segments": self.segments,
        }

    def sentences(self) -> list[str]:
        """Return a summary of the recording as lines of text.

        It states the sample period, the jitter, the lost samples, the share of rows that a fit can
        use, and the share that is left out for each reason.
        """
        c = self.timing
        out = [
            f"{self.name}: {self.seconds:.1f} s every {c.period_s * 1e3:.4g} ms "
            f"(± {c.jitter_s * 1e6:.0f} µs RMS, {c.gaps} gaps, {100 * c.lost_share:.2g} % lost)"
        ]
        if abs(c.period_s / self.control_period_s - 1) > 0.01:
            out.append(
                f"  the profile's period is {self.control_period_s * 1e3:.4g} ms: the log was not "
                "written at the control rate, so voltages between its samples are unknown"
            )
        reasons = ", ".join(f"{r} {100 * s:.1f} %" for r, s in self.left_out.items() if s > 0)
        out.append(
            f"  {100 * self.usable_share:.1f} % usable"
            + (f"; left out: {reasons}" if reasons else "")
            + (f"; {100 * self.clipped_share:.1f} % at the amplifier's limit, kept"
               if self.clipped_share > 0 else "")
        )  # fmt: skip
        return out


@dataclass(frozen=True, eq=False)
class Prepared:
    """Recordings, and ranges of usable rows in them: ``train`` to fit, ``held_out`` to validate."""

    recordings: tuple[Recording, ...]
    train: tuple[RowRange, ...]
    held_out: tuple[RowRange, ...]
    reports: tuple[RecordingReport, ...]
    dt: float
    """s: the sample interval of all recordings"""
    split: str
    """A sentence for the report on how the held-out data were chosen"""


def checked_timing(recording: Recording) -> Timing:
    """Return the statistics of a recording's time stamps.

    Raises RecordingError if the time stamps do not increase or are fewer than `MIN_SAMPLES`.
    """
    t = recording.t
    if len(t) < MIN_SAMPLES:
        raise RecordingError(
            f"{recording.name} has only {len(t)} samples; at least {MIN_SAMPLES} are needed.",
            cause="the flight ended at once, or the log was truncated.",
            fix=f"heli3dof info {quoted(recording.name)}; then repeat the flight",
        )
    check_time_increases(recording.name, t, lambda k: f"row {k + 1}")
    return timing(t)


def prepare(recordings: Sequence[Recording], *, held_out: Sequence[Recording] = ()) -> Prepared:
    """Return the recordings and two lists of usable row ranges: for the fit and for validation.

    The function also checks the time stamps of the recordings.

    Args:
        recordings: recordings to fit; all need roll, pitch and yaw, and the same sample interval.
        held_out: recordings to validate on. Without any, the last `HELD_OUT_SHARE` of each
            recording's usable time is set aside.

    Raises RecordingError for too few usable rows, a missing angle, constant voltages, or different
    sample intervals.
    """
    if not recordings:
        raise RecordingError(
            "No recording was given.",
            cause="the list of recordings is empty.",
            fix="heli3dof identify REC.mcap",
        )
    everything = (*recordings, *held_out)
    runs, reports = [], []
    for i, recording in enumerate(everything):
        _check_content(recording)
        found, report = _usable_runs(recording, i)
        runs.append(found)
        reports.append(report)
    dt = _common_period(everything)
    n = len(recordings)
    if held_out:
        train = [r for found in runs[:n] for r in found]
        test = [r for found in runs[n:] for r in found]
        names = ", ".join(r.name for r in held_out)
        split = f"validated on {names}, which is held-out data"
    else:
        train, test = [], []
        for found in runs:
            a, b = _split(found)
            train += a
            test += b
        split = (
            f"validated on the last {100 * HELD_OUT_SHARE:.0f} % of each recording, "
            "which is held-out data; a separate recording would be a stricter test"
        )
    _check_length(train, dt, recordings, reports[:n])
    return Prepared(everything, tuple(train), tuple(test), tuple(reports), dt, split)


def moving_axes_only(recording: Recording) -> Recording:
    """Return the recording with NaN for every angle that never changes: a clamped axis."""
    still = (recording.angle == recording.angle[0]).all(axis=0)
    if not still.any():
        return recording
    return replace(recording, angle=np.where(still, np.nan, recording.angle))


def still_axes(recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Return the axes without a measured motion.

    In every recording, the angle of such an axis is either constant or not measured.
    """
    moving = {a for r in recordings for a in moving_axes_only(r).axes}
    return tuple(a for a in AXES if a not in moving)


def segments(
    prepared: Prepared, runs: Sequence[RowRange], factor: int
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return (u, y), decimated by ``factor``, for each run of at least 2 · ``factor`` rows.

    u (N, 2) V are the mean voltages of N intervals, y (N, 3) rad the angles at their starts. The
    gaps of a run are filled first: voltages are held, angles interpolated.
    """
    out = []
    for run in runs:
        rec = prepared.recordings[run.source].rows(slice(run.start, run.stop))
        rec, own = fill_gaps(rec, LOST)
        count = len(rec) // factor
        if count < 2:
            continue
        rows = slice(0, count * factor)
        t = rec.t[rows]
        held = np.diff(np.append(t, t[-1] + rec.dt))[:, None]
        weight = held.reshape(count, factor, 1)
        v = rec.voltage[rows].reshape(count, factor, 2)
        u = (v * weight).sum(axis=1) / weight.sum(axis=1)
        y = np.column_stack([np.interp(t[::factor], rec.t[own], a[own]) for a in rec.angle.T])
        out.append((u, y))
    return out


def _check_content(recording: Recording) -> None:
    missing = [a for a in AXES if a not in recording.axes]
    if len(missing) == len(AXES):
        raise RecordingError(
            f"{recording.name} holds no angle.",
            cause="it has no samples, or its log has no column of angles.",
            fix="heli3dof run multisine, then identify from that recording",
        )
    if missing:
        raise RecordingError(
            f"{recording.name} is not usable alone: it holds {', '.join(recording.axes)}, but not "
            f"{', '.join(missing)}.",
            cause="a one-axis experiment. A black box needs all three angles; the grey box uses "
            "such a recording together with one that has all three.",
            fix="heli3dof run multisine, then identify from that (grey box: from both)",
        )
    if np.nanstd(recording.voltage, axis=0).max() < 1e-9:
        raise RecordingError(
            f"{recording.name}: both voltages are constant throughout.",
            cause="a coast-down, a ring-down, or a column that was logged before the controller.",
            fix="heli3dof run multisine, then identify from that recording",
        )


def _usable_runs(recording: Recording, source: int) -> tuple[list[RowRange], RecordingReport]:
    clock = checked_timing(recording)
    masks = unusable(recording)
    n = len(recording)
    bad = np.zeros(n, dtype=bool)
    left_out = {}
    for reason in REASONS:
        left_out[reason] = float((masks[reason] & ~bad).mean())
        bad |= masks[reason]
    period = clock.period_s
    found = runs_of(~bad, recording, source, LOST * period, SEGMENT_MIN_S / period)
    used = sum(r.stop - r.start for r in found) / n
    clip = float((clipped(recording) & ~bad).mean())
    report = RecordingReport(
        recording.name, recording.duration, clock, recording.profile.dt,
        int((np.diff(recording.t) > LOST * period).sum()), left_out, used, clip, len(found),
    )  # fmt: skip
    return found, report


def _common_period(recordings: Sequence[Recording]) -> float:
    periods = [r.dt for r in recordings]
    if max(periods) / min(periods) > 1.01:
        worst = recordings[int(np.argmax(periods))]
        raise RecordingError(
            f"{worst.name} was sampled every {max(periods) * 1e3:.4g} ms, "
            f"another recording every {min(periods) * 1e3:.4g} ms.",
            cause="recordings of different rigs or loops.",
            fix="identify each by a command of its own: heli3dof identify ONE.mcap",
        )
    period, nominal = float(np.median(periods)), recordings[0].profile.dt
    # Time stamps are rounded. If they agree with the profile, its value is the exact one.
    return nominal if abs(period / nominal - 1) < 1e-3 else period


def _split(runs: list[RowRange]) -> tuple[list[RowRange], list[RowRange]]:
    total = sum(r.stop - r.start for r in runs)
    keep = round(total * (1 - HELD_OUT_SHARE))
    train: list[RowRange] = []
    test: list[RowRange] = []
    for r in runs:
        length = r.stop - r.start
        cut = r.start + min(max(keep, 0), length)
        if cut > r.start:
            train.append(RowRange(r.source, r.start, cut))
        if cut < r.stop:
            test.append(RowRange(r.source, cut, r.stop))
        keep -= length
    return train, test


def _check_length(
    train: Sequence[RowRange],
    dt: float,
    recordings: Sequence[Recording],
    reports: Sequence[RecordingReport],
) -> None:
    seconds = sum(r.stop - r.start for r in train) * dt
    if seconds < USABLE_MIN_S:
        total = sum(r.seconds for r in reports)
        left_out = {k: sum(r.left_out[k] * r.seconds for r in reports) for k in REASONS}
        left_out["other"] = total - seconds - sum(left_out.values())
        parts = [f"{s:.1f} s {LEFT_OUT[k]}" for k, s in left_out.items() if s >= 0.05]
        cause, fix = why_short(
            recordings,
            "the flight is too short" + (f"; left out are {', '.join(parts)}." if parts else "."),
            "heli3dof run multisine; or fly longer after the climb",
        )
        raise RecordingError(
            f"{', '.join(r.name for r in reports)}: only {seconds:.1f} s of {total:.1f} s are "
            f"usable to fit a model, the minimum is {USABLE_MIN_S:.0f} s.",
            cause=cause,
            fix=fix,
        )
