"""Mark doubtful findings as unconfirmed ("…-like") if the controller is unknown.

Without it no flights can be simulated, so nothing shows which findings a model error may cause.
These findings are marked, with a confidence of `MOST_CONFIDENCE` at most:

1. `disturbance.periodic` at a frequency f of the commanded motion, because the model's errors in
   that motion have the same period. x(t) are the references (the angles, if none were logged). The
   share of x's variance in the spectral line at f reaches `LEAST_SHARE` on an axis:

       share(f) = 2 |mean (x − x̄) e^{−2πi f t}|² / var x

2. `mass.change` with more than one recording, or at a constant voltage. A change at the same time
   after the first sample of each flight is a drift, for example of warming motors. At a constant
   voltage, a weight and a thrust are the same torque.
3. A cause that no recording confirms on its own (`conclusion.single_recordings`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.conclusion.single_recordings import not_confirmed
from heli3dof.diagnosis.result import Finding
from heli3dof.recording.recording import Recording

LEAST_SHARE = 0.02
"""Share of the variance from which on a frequency belongs to the motion. Chosen; not derived."""
MOST_CONFIDENCE = 0.5
"""Largest confidence of a marked finding: as likely as not"""


def marked_if_recordings_disagree(
    findings: Sequence[Finding], recordings: Sequence[Recording]
) -> tuple[Finding, ...]:
    """Return the findings; doubtful ones (rules 1 to 3 of the module) are marked "…-like"."""
    unconfirmed = not_confirmed([f.term.name for f in findings], recordings)
    return tuple(
        marked_like(f) if f.term.name in unconfirmed or _is_doubtful(f, recordings) else f
        for f in findings
    )


def marked_like(f: Finding) -> Finding:
    """Return the finding marked "…-like", with a confidence of at most `MOST_CONFIDENCE`."""
    confidence = min(f.choice.confidence, MOST_CONFIDENCE)
    return replace(f, unconfirmed=True, choice=replace(f.choice, confidence=confidence))


def _is_doubtful(f: Finding, recordings: Sequence[Recording]) -> bool:
    name = f.term.effect.name
    if name == "mass.change":
        return len(recordings) > 1 or any(constant_voltage(r) for r in recordings)
    if name == "disturbance.periodic":
        return any(is_in_motion(r, f.values["frequency_Hz"][0]) for r in recordings)
    return False


def constant_voltage(recording: Recording) -> tuple[int, int] | None:
    """Return (first, last) row with both motors on, if their voltages are constant and equal.

    Otherwise, or if the motors are switched off in between, the result is None.
    """
    V = recording.voltage
    on = np.flatnonzero((V > 0).all(axis=1))
    if not len(on) or np.ptp(V[on]) > 1e-9 or on[-1] - on[0] + 1 != len(on):
        return None
    return int(on[0]), int(on[-1])


def is_in_motion(recording: Recording, frequency_Hz: float) -> bool:
    """Return whether the references (angles, if none) have a spectral line at the frequency."""
    r = recording
    x = r.reference if np.isfinite(r.reference).any() else r.angle
    return any(line_share(r.t, x[:, i], frequency_Hz) >= LEAST_SHARE for i in range(x.shape[1]))


def line_share(t: np.ndarray, x: np.ndarray, frequency_Hz: float) -> float:
    """Return the spectral line's share of the variance of x (N,); t (N,) in s; 0 for constant x."""
    finite = np.isfinite(x)
    if finite.sum() < 2:
        return 0.0
    t, x = t[finite], x[finite] - x[finite].mean()
    power = float(x @ x) / len(x)
    if power <= 1e-12:
        return 0.0
    line = np.mean(x * np.exp(-2j * np.pi * frequency_Hz * t))
    return float(2 * abs(line) ** 2 / power)
