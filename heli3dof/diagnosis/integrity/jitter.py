"""``timing.jitter``: samples that are not taken when they are due.

The time stamps show it if they are the sampling times (`heli3dof.recording.logs.sampling_clock`).
Behind an even clock the motion shows it (`heli3dof.recording.logs.sampling_jitter`): every axis is
off by its rate times the same δ. If both are there, σ² = σ_stamps² + σ_motion². Stamps of arrival,
which the motion contradicts, are only noted: every analysis then uses an even clock.

A host without real-time priority is late by tens of microseconds: at 100°/s that moves an angle
by a tenth of a count. Such jitter is said and is no finding; from `WORTH_NAMING_S` on it is one.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heli3dof.diagnosis.integrity.base import Check, Fault, Kind, Stage
from heli3dof.diagnosis.integrity.view import View
from heli3dof.recording.logs.sampling_clock import sampling_times
from heli3dof.recording.logs.sampling_jitter import motion_jitter

WORTH_NAMING_S = 8e-5
"""360°/4096 / 10 / 100°/s"""
WORTH_SAYING_S = 1e-5


def jitter(view: View) -> Iterable[Fault]:
    r = view.recording
    if len(r) < 20 or not (np.diff(r.t) > 0).all():
        return
    seen, std = view.ticks.jitter_s, view.ticks.jitter_std_s
    sampled = sampling_times(r)
    if sampled is not r:
        yield Fault(
            "timing.arrival", Kind.NOTE, r.name,
            f"{r.name}: the time stamps scatter by ±{1e3 * seen:.3g} ms (RMS), but the motion "
            "shows evenly spaced samples, so an even clock replaces the stamps.",
            "the computer stamped the samples on arrival, several at a time.",
            "log the device's own time stamps",
        )  # fmt: skip
        r, seen = sampled, 0.0
    hidden = motion_jitter(r.t, r.angle, r.profile.encoder.rad_per_count)
    if hidden.found:
        sigma = float(np.hypot(seen, hidden.sigma_s))
        yield Fault(
            "timing.jitter", Kind.FINDING, r.name,
            f"{r.name}: the angles have a sampling jitter of ±{1e3 * hidden.sigma_s:.2g} ms (RMS) "
            f"that the {'even' if seen < WORTH_SAYING_S else 'jittery'} time stamps do not show: "
            "all axes jump together in proportion to their rates.",
            "the logging host was late, caught up, and wrote the planned times.",
            "log the device's own time stamps; close other programs on the logging computer",
            effect="timing.jitter",
            parameters={"jitter_s": (sigma, hidden.variance_std_s2 / (2 * sigma))},
        )  # fmt: skip
    elif seen >= WORTH_SAYING_S:
        named = seen >= WORTH_NAMING_S
        yield Fault(
            "timing.jitter", Kind.FINDING if named else Kind.NOTE, r.name,
            f"{r.name}: the time stamps have a sampling jitter of ±{1e6 * seen:.3g} µs (RMS)"
            + ("." if named else ", which is usual for a computer's timer."),
            "a timer without real-time priority, or a shared bus.",
            "chrt -f 50 heli3dof run-step --roll 5, which reports how many periods were late"
            if named else "nothing to do",
            effect="timing.jitter", parameters={"jitter_s": (seen, std)},
        )  # fmt: skip


CHECKS = (Check("timing.jitter", Stage.CLOCK, "sampling jitter in time stamps or motion", jitter),)
