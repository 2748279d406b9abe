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
                f"{r.name}: {int((~np.isfinite(r.t)).sum())} time stamps are no numbers.",
                cause="cells were left empty, or the clock was not read.",
                fix="remove these rows: a gap in time is understood",
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
        f"{r.name} is sampled at {1 / view.ticks.period_s:.5g} Hz by its time stamps; the "
        f"profile's loop runs at {r.profile.loop.rate_hz:.5g} Hz"
    )
    fix = f"correct t_s, or set loop.rate_hz = {1 / view.ticks.period_s:.5g} in the profile"
    whole = max(m, 1 / m)
    if abs(m - 1) <= OFF:
        yield Fault("clock.rate", Kind.NOTE, r.name, f"{says}: {100 * (m - 1):+.2g} % off.",
                    "the host's timer is not the device's.", fix)  # fmt: skip
    elif abs(whole - round(whole)) > OFF * whole or _clock_is_wrong(view, m):
        yield Fault(
            "clock.rate", Kind.BAD_DATA, r.name,
            f"{says}. If the stamps are wrong, so is every rate ({m:.3g} times) and every "
            f"acceleration ({m**2:.3g} times).",
            "the stamps come from another clock, or the profile is another rig's.", fix,
        )  # fmt: skip
    else:
        yield Fault(
            "clock.rate", Kind.NOTE, r.name,
            f"{says}: what the voltages did in between is not known"
            + (", and taken to lie on the line between." if m > 1 else "."),
            "only some of the samples were logged, or each one several times.",
            "log every sample of the loop; if the loop itself is that slow, set loop.rate_hz = "
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
            "one of the two is set by another program, or counts ticks of another length.",
            "time a flight with a watch and keep the clock that is right: heli3dof export REC -o "
            "rec.csv, make it t_s there, heli3dof import rec.csv",
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
            f"{r.name}: {100 * share:.3g} % of the rows repeat the row before in every angle and "
            "voltage while the rig flies.",
            "the log runs faster than the loop, or samples were written twice to fill gaps.",
            "log once per sample; remove the repeated rows (a gap in time is understood)",
            confidence=0.99,
        )  # fmt: skip


CHECKS = (
    Check("clock", Stage.CLOCK, "time runs backwards, in ms, or at another rate", clock),
    Check("clock.repeated", Stage.CLOCK, "rows written twice", repeated),
)
