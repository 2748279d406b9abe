"""Does time run forwards, in seconds, at the profile's rate, and does every row say something new?

A rate that is not the profile's may be an honest log of every m-th sample, or a clock that runs
fast or slow by m. The motion tells: accelerations go with 1/time², so a clock that is m times too
fast makes every axis answer the voltages 1/m² times as strongly as the profile says, while the
voltage at hover, which knows no time, stays what it was.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heli3dof.diagnosis.integrity.base import Check, Fault, Kind, Stage, refused
from heli3dof.diagnosis.integrity.view import View
from heli3dof.errors import RecordingError
from heli3dof.recording.logs.log_validation import long_enough, time_increases

OFF, WORTH_SAYING = 0.02, 0.002
"""Share by which the rate may differ from the profile's, and from which on it is said."""
DEVICE_OFF = 0.005
REPEATED = 0.02
NEAR = 51
"""Rows around one in which the voltage must change now and then."""


def clock(view: View) -> Iterable[Fault]:
    """The order of the stamps; where they are in order, their rate and the device's."""
    found = [*order(view)]
    yield from found
    if not found:
        yield from rate(view)
        yield from device(view)


def order(view: View) -> Iterable[Fault]:
    """Time that stands still, runs backwards, or is in milliseconds."""
    r = view.recording
    try:
        long_enough(r.name, len(r))
        if not np.isfinite(r.t).all():
            raise RecordingError(
                f"{r.name}: {int((~np.isfinite(r.t)).sum())} time stamps are not finite.",
                cause="cells are empty, or the clock was not read.",
                fix="remove these rows; gaps in time are allowed",
            )
        time_increases(r.name, r.t, r.profile.dt, lambda k: f"row {k + 1}")
    except RecordingError as error:
        yield refused("clock.order", view, error)


def rate(view: View) -> Iterable[Fault]:
    """The rate of the stamps against the profile's ``loop.rate_hz``."""
    r = view.recording
    m = view.ticks.period_s / r.profile.dt
    if abs(m - 1) <= WORTH_SAYING:
        return
    says = (
        f"{r.name}: the time stamps give {1 / view.ticks.period_s:.5g} Hz, the profile's "
        f"loop.rate_hz is {r.profile.loop.rate_hz:.5g} Hz"
    )
    fix = f"correct t_s, or set loop.rate_hz = {1 / view.ticks.period_s:.5g} in the profile"
    whole = max(m, 1 / m)
    if abs(m - 1) <= OFF:
        yield Fault("clock.rate", Kind.NOTE, r.name,
                    f"{says}: a difference of {100 * (m - 1):+.2g} %.",
                    "the host's timer differs from the device's.", fix)  # fmt: skip
    elif abs(whole - round(whole)) > OFF * whole or _clock_is_wrong(view, m):
        yield Fault(
            "clock.rate", Kind.BAD_DATA, r.name,
            f"{says}. With wrong time stamps, rates are wrong by a factor of {m:.3g} and "
            f"accelerations by {m**2:.3g}.",
            "the stamps come from another clock, or the profile belongs to another rig.", fix,
        )  # fmt: skip
    else:
        yield Fault(
            "clock.rate", Kind.NOTE, r.name,
            f"{says}: the voltages between samples are unknown"
            + (" and are interpolated." if m > 1 else "."),
            "the log is decimated, or repeats samples.",
            "log every sample of the loop; if the loop is that slow, set loop.rate_hz = "
            f"{1 / view.ticks.period_s:.5g} in the profile",
        )  # fmt: skip


def _clock_is_wrong(view: View, m: float) -> bool:
    """The motion fits the profile with the profile's period, not with the stamps'."""
    gains = [x.gain for x in view.responses.values() if x.t > 6 and x.explained > 0.5]
    if not gains:
        return False
    g = float(np.median(np.log(gains)))
    return bool(abs(g + 2 * np.log(m)) < abs(g))


def device(view: View) -> Iterable[Fault]:
    """The device's own clock against the stamps."""
    r = view.recording
    own = r.channels.get("device_time_s")
    if own is None or not np.isfinite(own).all() or np.ptp(own) == 0:
        return
    off = float(np.ptp(own) / r.duration) - 1
    if abs(off) > DEVICE_OFF:
        yield Fault(
            "clock.device", Kind.BAD_DATA, r.name,
            f"{r.name}: the device's clock runs {100 * off:+.3g} % against t_s "
            f"({np.ptp(own):.4g} s against {r.duration:.4g} s).",
            "another program sets one of the clocks, or one counts ticks of another length.",
            "time a flight with a stopwatch to find the right clock; heli3dof export REC -o "
            "rec.csv, write it to t_s, heli3dof import rec.csv",
        )  # fmt: skip


def repeated(view: View) -> Iterable[Fault]:
    """Rows that repeat the one before in everything that was flown, off the limiter.

    In closed loop the voltage answers every count and filters in between, so it is never twice
    the same; a constant voltage (open loop) says nothing here. With one axis let go and the
    others at rest it may stand for a few rows: then what the experiment adds does not.
    """
    r = view.recording
    if len(r) < 2 * NEAR:
        return
    flown = np.hstack([r.voltage, r.angle, r.voltage_extra])
    same = ((np.diff(flown, axis=0) == 0) | np.isnan(flown[1:])).all(axis=1)
    same &= np.isfinite(r.voltage[1:]).all(axis=1)
    told = ~view.clipped[1:] & (np.abs(r.voltage[1:]) > 1e-9).any(axis=1)
    changes = (np.diff(r.voltage, axis=0) != 0).any(axis=1)
    told &= np.convolve(changes.astype(float), np.ones(NEAR), "same") > NEAR / 10
    if told.sum() < 100:
        return
    share = float((same & told).sum() / told.sum())
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
    Check("clock", Stage.CLOCK, "time stamps that decrease, in ms, or of another rate", clock),
    Check("clock.repeated", Stage.CLOCK, "repeated rows", repeated),
)
