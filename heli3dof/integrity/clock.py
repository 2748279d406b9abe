"""Check time stamps: their order, their rate, the device's clock, and repeated rows.

Let m be the sampling period of the time stamps, divided by the profile's control period. If
|m − 1| > `OFF`, there are two possible causes. Either the time stamps are wrong, which is bad data.
Or the log is decimated or repeats samples, which is only a note. The time stamps are wrong if one
of these holds:

- Neither m nor 1/m is nearly an integer.
- The measured accelerations fit the profile's period better than the period of the time stamps:
  |ln g + 2 ln m| < |ln g|.

`View.responses` gives the acceleration that the voltages cause on an axis, as a multiple of the
profile's prediction. g is the median of these multiples over the axes. Accelerations scale with
1/time². So g is about 1 with right time stamps, and about 1/m² with wrong ones.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heli3dof.errors import RecordingError
from heli3dof.integrity.base import Check, Fault, Kind, Stage, bad_data_fault
from heli3dof.integrity.directions import EXPLAINED, SURE
from heli3dof.integrity.view import View
from heli3dof.recording.logs.log_validation import check_length, check_sampling_times

OFF, REPORTED_OFF = 0.02, 0.002
"""Limits of |m − 1| (m: period over the profile's) for bad data and for a note. Chosen, as are all
constants below."""
DEVICE_OFF = 0.005
REPEATED = 0.02
"""Largest share of repeated rows"""
SAMPLE_NUMBERS = ("device_time_s", "sequence")
"""Channels that differ from sample to sample"""
NEAR = 51
"""Rows of a window: `repeated` tests a row if the voltage changes in over a tenth of its window."""


def clock(view: View) -> Iterable[Fault]:
    """Check the time stamps by `order`; if it finds no fault, check them by `rate` and `device`."""
    faults = [*order(view)]
    yield from faults
    if not faults:
        yield from rate(view)
        yield from device(view)


def order(view: View) -> Iterable[Fault]:
    """Yield a fault if time stamps do not increase, are not finite, or are in milliseconds."""
    r = view.recording
    try:
        check_length(r.name, len(r))
        if not np.isfinite(r.t).all():
            raise RecordingError(
                f"{r.name}: {int((~np.isfinite(r.t)).sum())} time stamps are not finite.",
                cause="cells are empty, or the clock was not read.",
                fix="remove these rows; gaps in time are allowed",
            )
        check_sampling_times(r.name, r.t, r.profile.dt, lambda k: f"row {k + 1}")
    except RecordingError as error:
        yield bad_data_fault("clock.order", view, error)


def rate(view: View) -> Iterable[Fault]:
    """Yield a fault if the rate of the time stamps differs from the profile's ``loop.rate_hz``."""
    r, rate_hz = view.recording, 1 / view.sampling_clock.period_s
    m = view.sampling_clock.period_s / r.profile.dt
    if abs(m - 1) <= REPORTED_OFF:
        return
    sentence = (
        f"{r.name}: the time stamps give {rate_hz:.5g} Hz, the profile's "
        f"loop.rate_hz is {r.profile.loop.rate_hz:.5g} Hz"
    )
    fix = f"correct t_s, or set loop.rate_hz = {rate_hz:.5g} in the profile"
    whole = max(m, 1 / m)
    if abs(m - 1) <= OFF:
        yield Fault("clock.rate", Kind.NOTE, r.name,
                    f"{sentence}: a difference of {100 * (m - 1):+.2g} %.",
                    "the host's timer differs from the device's.", fix)  # fmt: skip
    elif abs(whole - round(whole)) > OFF * whole or _clock_is_wrong(view, m):
        yield Fault(
            "clock.rate", Kind.BAD_DATA, r.name,
            f"{sentence}. With wrong time stamps, rates are wrong by a factor of {m:.3g} and "
            f"accelerations by {m**2:.3g}.",
            "the stamps come from another clock, or the profile belongs to another rig.", fix,
        )  # fmt: skip
    else:
        yield Fault(
            "clock.rate", Kind.NOTE, r.name,
            f"{sentence}: the voltages between samples are unknown"
            + (" and are interpolated." if m > 1 else "."),
            "the log is decimated, or repeats samples.",
            "log every sample of the loop; if the loop is that slow, set loop.rate_hz = "
            f"{rate_hz:.5g} in the profile",
        )  # fmt: skip


def _clock_is_wrong(view: View, m: float) -> bool:
    """Return True if the measured accelerations show that the time stamps are wrong.

    ``m``: sampling period of the time stamps, divided by the control period in the profile. g is
    the acceleration that the voltages cause, divided by the profile's prediction (median over the
    axes). With right time stamps, g is about 1. With wrong time stamps, g is about 1/m². The result
    is True if ln g is closer to ln(1/m²) than to 0. It is False if no axis has a reliable g.
    """
    gains = [x.gain for x in view.responses.values() if x.t > SURE and x.explained > EXPLAINED]
    if not gains:
        return False
    g = float(np.median(np.log(gains)))
    return bool(abs(g + 2 * np.log(m)) < abs(g))


def device(view: View) -> Iterable[Fault]:
    """Yield a fault if the device's clock and the time stamps differ in rate."""
    r = view.recording
    device_s = r.channels.get("device_time_s")
    if device_s is None or not np.isfinite(device_s).all() or np.ptp(device_s) == 0:
        return
    off = float(np.ptp(device_s) / r.duration) - 1
    if abs(off) > DEVICE_OFF:
        yield Fault(
            "clock.device", Kind.BAD_DATA, r.name,
            f"{r.name}: the device's clock runs {100 * off:+.3g} % against t_s "
            f"({np.ptp(device_s):.4g} s against {r.duration:.4g} s).",
            "another program sets one of the clocks, or one counts ticks of another length.",
            "time a flight with a stopwatch to find the right clock; heli3dof export REC -o "
            "rec.csv, write it to t_s, heli3dof import rec.csv",
        )  # fmt: skip


def repeated(view: View) -> Iterable[Fault]:
    """Yield a fault if more than the share `REPEATED` of the tested rows repeat the previous row.

    A row is tested if its voltages are neither zero nor at the limit. The voltages must also change
    in more than a tenth of the `NEAR` rows around the tested row.

    A repeated row equals the previous row in all angles and all logged voltages. These are the
    voltages at the motors, the controller's output, and the voltages that the experiment added. If
    the log contains the device's time or the sample's sequence number, they must be equal, too.
    Without them, a new sample can look like a repeated row: the rig rests, and the voltages stay
    the same because the next command is late.
    """
    r = view.recording
    if len(r) < 2 * NEAR:
        return
    own = [r.channels[name] for name in SAMPLE_NUMBERS if name in r.channels]
    flown = np.column_stack([r.voltage, r.angle, r.voltage_extra, r.voltage_cmd, *own])
    same = ((np.diff(flown, axis=0) == 0) | np.isnan(flown[1:])).all(axis=1)
    same &= np.isfinite(r.voltage[1:]).all(axis=1)
    usable = ~view.clipped[1:] & (np.abs(r.voltage[1:]) > 1e-9).any(axis=1)
    changes = (np.diff(r.voltage, axis=0) != 0).any(axis=1)
    usable &= np.convolve(changes.astype(float), np.ones(NEAR), "same") > NEAR / 10
    if usable.sum() < 100:
        return
    share = float((same & usable).sum() / usable.sum())
    if share > REPEATED:
        yield Fault(
            "clock.repeated", Kind.BAD_DATA, r.name,
            f"{r.name}: {100 * share:.3g} % of the rows in flight repeat the previous row's angles "
            "and voltages.",
            "the log runs faster than the loop, or samples were written twice to fill gaps.",
            "log once per sample; remove the repeated rows (gaps in time are allowed)",
            confidence=0.99,
        )  # fmt: skip


CHECKS = (
    Check(
        "clock", Stage.CLOCK, "time stamps that decrease, in ms, or of another rate", clock,
        ("clock.order", "clock.rate", "clock.device"),
    ),
    Check("clock.repeated", Stage.CLOCK, "repeated rows", repeated),
)  # fmt: skip
