"""Check a log's values, times and voltages.

A fault that would make every result wrong raises an error. Other faults are returned as warnings,
which `import_log` stores in ``Recording.meta["warnings"]`` and ``heli3dof info`` prints. Arguments:
``source`` is the log's name; ``where`` returns a sample's position in the file as text.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from heli3dof.errors import RecordingError
from heli3dof.recording.logs.held_angles import (
    HELD_CAUSE,
    held_angles_clause,
    held_axes,
    one_row_per_reading,
)
from heli3dof.recording.logs.known_names import IMPORT, as_options
from heli3dof.recording.logs.sampling_clock import estimate_clock
from heli3dof.recording.logs.sampling_jitter import motion_jitter

MIN_SAMPLES = 10
"""Smallest number of samples in a log (a convention)"""
MAX_LOST_SHARE = 0.3
"""Largest share of lost samples in a usable recording. Chosen."""
SAME_PERIOD = 0.01
"""Largest relative difference of the mean interval from the control period, for rounded times
(a convention)"""
JITTER = 0.02
"""RMS scatter of the intervals, as a share of the period, above which there is a warning (a
convention)"""

Where = Callable[[int], str]
"""Returns the position of sample k in the log, for messages: ``line 12``"""


def lost_rows(source: str, columns: Mapping[str, np.ndarray], where: Where) -> np.ndarray:
    """Return (N,) bool: the rows with a value that is not finite, which count as lost samples.

    Raises RecordingError if their share exceeds `MAX_LOST_SHARE`.
    """
    finite = {name: np.isfinite(values) for name, values in columns.items()}
    lost = ~np.logical_and.reduce(list(finite.values()))
    if lost.mean() <= MAX_LOST_SHARE:
        return np.asarray(lost)
    name = min(finite, key=lambda n: finite[n].sum())
    k, count = int(np.argmin(finite[name])), int((~finite[name]).sum())
    kind = "no number" if np.isnan(columns[name][k]) else "infinity"
    raise RecordingError(
        f"{source}: {where(k)}, column {name}: {kind}"
        + (f" (and {count - 1} more in this column)." if count > 1 else "."),
        cause="a sensor that was not read, or signals with different sample times.",
        fix="remove these rows (gaps in time are allowed) or the whole column",
    )


@dataclass(frozen=True)
class Timing:
    """Statistics of a recording's time stamps: sample interval, its scatter, and gaps."""

    period_s: float
    """s, median interval between samples"""
    rate_hz: float
    jitter_s: float
    """s, RMS deviation of the intervals, gaps excluded, from the median. If the time stamps have
    independent errors, it is √2 times the RMS of these errors (`sampling_clock.Ticks.jitter_s`)."""
    gaps: int
    """Number of intervals in which samples are missing (`SamplingClock.missing`)"""
    longest_gap_s: float
    """s, longest interval between two samples with missing samples in between"""
    lost_share: float
    """Samples missing in the gaps, as a share of all expected samples"""


def timing(t: np.ndarray) -> Timing:
    """Return the statistics of sample times ``t`` (N,) in s, strictly increasing, N ≥ 2."""
    dt = np.diff(t)
    period = float(np.median(dt))
    clock = estimate_clock(t)
    missing = clock.missing
    gap, lost = missing > 0, int(missing.sum())
    return Timing(
        period_s=period,
        rate_hz=1 / period,
        jitter_s=float(np.sqrt(np.mean((dt[~gap] - period) ** 2))) if (~gap).any() else 0.0,
        gaps=int(gap.sum()),
        longest_gap_s=float(dt[gap].max()) if gap.any() else 0.0,
        lost_share=lost / (len(t) + lost),
    )


def check_length(source: str, n: int) -> None:
    """Raise RecordingError if ``n``, the number of samples of the log ``source``, is below ten."""
    if n < MIN_SAMPLES:
        raise RecordingError(
            f"{source} has {n} sample{'s' * (n != 1)}; at least {MIN_SAMPLES} are needed.",
            cause="the logging program was stopped at once, or the file is incomplete.",
            fix="record again, or copy the whole file",
        )


def check_time_increases(
    source: str, t: np.ndarray, where: Where, period_s: float | None = None
) -> None:
    """Raise RecordingError if the time t (N,) s does not increase at every sample.

    ``period_s``: the profile's control period. If two times are equal, but the mean interval is
    ``period_s``, the log's times were rounded. The error then advises the user to compute the time
    from the sample's number.
    """
    dt = np.diff(t)
    wrong = ~(dt > 0)
    if wrong.any():
        k = int(np.argmax(wrong))
        same = dt[k] == 0
        # Times that start again from the first one are those of a second log.
        repeated = len(t) - len(np.unique(t)) if t[k + 1] > t[0] else 0
        mean_s = (t[-1] - t[0]) / (len(t) - 1)
        is_rounded = same and period_s is not None and abs(mean_s / period_s - 1) < SAME_PERIOD
        if not same and not t[k + 1 :].any():
            raise RecordingError(
                f"{source}: t_s is 0 from {where(k + 1)} to the end ({len(t) - k - 1} of {len(t)} "
                "samples).",
                cause="the rows at the end are zeros of a buffer that the flight did not fill.",
                fix=f"remove the rows from {where(k + 1)} on",
            )
        raise RecordingError(
            f"{source}: time does not increase at {where(k + 1)}: "
            f"t_s = {t[k + 1]:.9g} after {t[k]:.9g}.",
            cause="times were printed with too few digits."
            if is_rounded
            else "times were printed with too few digits, or a sample was logged twice."
            if same
            else f"{repeated} rows have the time of another row: they were written twice."
            if repeated
            else "two logs in one file, unsorted rows, or a clock that was set back.",
            fix=f"{IMPORT} {as_options({'t_s': f'sample/{1 / period_s:g}'})}, if no sample is "
            "missing; or print t_s with more digits"
            if is_rounded and period_s
            else "print t_s with more digits, or remove the repeated rows"
            if same
            else "remove the repeated rows; keep one log per file"
            if repeated
            else f"keep one log per file; sort the rows of {source} by t_s",
        )


def check_sampling_times(
    source: str, t: np.ndarray, period_s: float, where: Where, expression: str = "t_s"
) -> list[str]:
    """Raise RecordingError if t (N,) does not increase or is not in seconds; return warnings.

    Warnings are on gaps, on jitter, and on a sampling period other than ``period_s``, the profile's
    control period. ``expression``: how ``t`` was computed from the log's columns, for messages.
    """
    check_time_increases(source, t, where, period_s)
    found = timing(t)
    if found.period_s == 1 and period_s < 0.5 and (t == np.rint(t)).all():
        raise RecordingError(
            f"{source}: t_s contains whole numbers in steps of 1; the profile's period is "
            f"{period_s:.6g} s.",
            cause="t_s is the number of the sample.",
            fix="divide t_s by the rate: " + as_options({"t_s": f"{expression}/{1 / period_s:g}"}),
        )
    for factor, unit in ((1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")):
        if 0.5 < found.period_s / (period_s * factor) < 2:
            raise RecordingError(
                f"{source}: t_s steps by {found.period_s:.6g}; the profile's period is "
                f"{period_s:.6g} s.",
                cause=f"t_s is in {unit}.",
                fix=f"divide t_s by {factor:.0f}: "
                + as_options({"t_s": f"{expression}/{factor:.0f}"}),
            )
    warnings: list[str] = []
    if abs(found.period_s / period_s - 1) > 0.02:
        warnings.append(
            f"Sampled at {found.rate_hz:.6g} Hz, but the profile's loop.rate_hz is "
            f"{1 / period_s:.6g} Hz: the voltages between samples are unknown."
        )
    if found.gaps:
        warnings.append(
            f"{found.gaps} gap{'s' * (found.gaps != 1)} in time ({100 * found.lost_share:.2g} % "
            "of the samples are missing, the longest interval between samples is "
            f"{found.longest_gap_s:.3g} s)."
        )
    if found.jitter_s > JITTER * found.period_s:
        warnings.append(
            f"Sampling jitter: the intervals between samples scatter by {1e3 * found.jitter_s:.3g} "
            f"ms (RMS) about {1e3 * found.period_s:.4g} ms."
        )
    return warnings


def hidden_timing_warnings(
    t: np.ndarray, angle: np.ndarray, rad_per_count: np.ndarray
) -> list[str]:
    """Return a warning if the angles (N, 3) rad show a timing fault that ``t`` (N,) s does not.

    There are two such faults. The log repeats each encoder reading in several rows (`held_angles`),
    or the samples were not taken at equal intervals (`sampling_jitter`). Jitter is estimated only
    if no reading is repeated. ``rad_per_count`` (3,): the encoders' steps.
    """
    if held := held_axes(angle, rad_per_count):
        rate_hz = 1 / float(np.median(np.diff(t)))
        return [
            f"Held angles: {held_angles_clause(held, rate_hz)}. Likely cause: {HELD_CAUSE} Try: "
            f"{one_row_per_reading(held, rate_hz)}"
        ]
    found = motion_jitter(t, angle, rad_per_count)
    if not found.is_significant:
        return []
    return [
        f"Hidden sampling jitter of ±{1e3 * found.sigma_s:.2g} ms (RMS): all axes jump together in "
        "proportion to their rates. Likely cause: the logging host was late and caught up. Angular "
        "rates from this log are noisy."
    ]


def check_voltages(
    source: str,
    front: np.ndarray,
    back: np.ndarray,
    v_max: float,
    expressions: tuple[str, str] = ("v_front_V", "v_back_V"),
) -> list[str]:
    """Check voltages against the limit ``v_max`` (V); return warnings.

    ``front``, ``back``: the motors' voltages (N,) in V. ``expressions``: how these two were
    computed from the log's columns, for messages. Raises RecordingError for voltages above 20 times
    the limit.
    """
    warnings, beyond = list[str](), list[str]()
    tops = [float(np.abs(v).max()) for v in (front, back)]
    each = list(zip(("v_front_V", "v_back_V"), tops, expressions, strict=True))
    in_volts = {name: f"{text}/1000" for name, top, text in each if top > 20 * v_max}
    for name, top, _ in each:
        command = f"{name[:-2]}_cmd_V"
        if top > 20 * v_max:
            raise RecordingError(
                f"{source}: {name} reaches {top:.6g}; the profile's limit is ±{v_max:.6g} V.",
                cause="millivolts or DAC counts instead of volts, or the command instead of the "
                "limiter's output.",
                fix=f"convert it to volts: {as_options(in_volts)}; rename a command to {command}",
            )
        if top > 1.001 * v_max:
            beyond.append(f"{name} reaches {top:.4g} V")
    if beyond:
        warnings.append(
            f"{' and '.join(beyond)}, beyond the profile's limit of ±{v_max:.4g} V. Likely cause: "
            "the log contains the controller's output before the limiter, sum and difference, or "
            "per cent of the limit. "
            "Identification, diagnosis and comparison limit the voltages. If the amplifier's limit "
            "is higher, correct motor.v_max in the profile."
        )
    if np.ptp(front) == 0 and np.ptp(back) == 0:
        warnings.append(
            f"The input is constant ({front[0]:.4g} V and {back[0]:.4g} V throughout): "
            "no model can be identified."
        )
    return warnings
