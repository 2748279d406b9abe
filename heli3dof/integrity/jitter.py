"""Report ``timing.jitter``: samples that are not taken at equal intervals.

If the time stamps are the sampling times, they show the jitter
(`heli3dof.recording.logs.sampling_clock`). Fits and simulations use these times, so this jitter
causes no simulation error. If the stamps are even, the motion shows the jitter: the
angle of every axis is off by its rate times the same time error δ
(`heli3dof.recording.logs.sampling_jitter`). If stamps and motion show jitter, the variances add:
σ² = σ_stamps² + σ_motion². If the stamps are jittery but the samples were taken evenly, the stamps
are times of arrival, and the check reports the note ``timing.arrival``.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.remedies import is_log
from heli3dof.integrity.view import View
from heli3dof.recording.logs.sampling_clock import sampling_times
from heli3dof.recording.logs.sampling_jitter import motion_jitter

FINDING_S = 8e-5
"""s: an axis at 100°/s moves by a tenth of a count (360°/4096) in this time. Less is a note: hosts
without real-time priority are late by tens of microseconds."""
NOTE_S = 1e-5
"""s: a smaller jitter of the stamps is not reported. Chosen."""
LOGGED = "log the device's own time stamps; close other programs on the logging computer"
FLOWN = "chrt -f 50 heli3dof run-step --roll 5, which reports how many periods were late"
"""Remedies for a log of another program, and for a recording of heli3dof"""


def jitter(view: View) -> Iterable[Fault]:
    r = view.recording
    if len(r) < 20 or not (np.diff(r.t) > 0).all() or view.held_axes:
        return
    stamps_s, std = view.sampling_clock.jitter_s, view.sampling_clock.jitter_std_s
    sampled = sampling_times(r)
    if sampled is not r:
        yield Fault(
            "timing.arrival", Kind.NOTE, r.name,
            f"{r.name}: the time stamps scatter by ±{1e3 * stamps_s:.3g} ms (RMS), but the motion "
            "shows evenly spaced samples, so an even clock replaces the stamps.",
            "the computer stamped the samples on arrival, several at a time.",
            "log the device's own time stamps",
        )  # fmt: skip
        r, stamps_s = sampled, 0.0
    motion = motion_jitter(r.t, r.angle, r.profile.encoder.rad_per_count)
    if motion.is_significant:
        sigma = float(np.hypot(stamps_s, motion.sigma_s))
        yield Fault(
            "timing.jitter", Kind.FINDING, r.name,
            f"{r.name}: the angles have a sampling jitter of ±{1e3 * motion.sigma_s:.2g} ms (RMS) "
            f"that the {'even' if stamps_s < NOTE_S else 'jittery'} time stamps do not show: "
            "all axes jump together in proportion to their rates.",
            "the logging host was late, caught up, and wrote the planned times.",
            LOGGED,
            effect="timing.jitter",
            parameters={"jitter_s": (sigma, motion.variance_std_s2 / (2 * sigma))},
        )  # fmt: skip
    elif stamps_s >= NOTE_S:
        is_finding = stamps_s >= FINDING_S
        yield Fault(
            "timing.jitter", Kind.FINDING if is_finding else Kind.NOTE, r.name,
            f"{r.name}: the time stamps differ from an even clock by ±{1e3 * stamps_s:.2g} ms (RMS)"
            + ("." if is_finding else ", which is usual for a computer's timer."),
            "a timer without real-time priority, or a shared bus.",
            (LOGGED if is_log(r) else FLOWN) if is_finding else "",
            effect="timing.jitter", parameters={"jitter_s": (stamps_s, std)}, allowed_for=True,
        )  # fmt: skip


CHECKS = (
    Check(
        "timing.jitter", Stage.CLOCK, "sampling jitter in time stamps or motion", jitter,
        ("timing.jitter", "timing.arrival"),
    ),
)  # fmt: skip
