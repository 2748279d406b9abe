"""Names that a log of unknown loop cannot bear: no flight says what a model error would look like.

A periodic torque of frequency f: whatever the model gets wrong of a motion that was commanded with
a period comes back with that period. With x the references (the angles, where none was logged) and

    share(f) = 2 |mean (x − x̄) e^{−2πi f t}|² / var x

the part of its variance in a line at f (8/π²k² for the k-th harmonic of a square wave), such a
torque is not told from the model's own error where share(f) is `LINE` or more on some axis.

A mass change has one time after a recording's first sample. Recordings of different flights that
share it share a drift (of motors that get warm), or its formula. And at one constant voltage a
weight and a thrust are one and the same torque, whenever it changes.

And what no recording shows by itself, but only their comparison
(`free_run.single_recordings`).

Such a finding keeps its place and its fit, as "…-like", with a certainty of `EVEN` at most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.free_run.single_recordings import only_compared
from heli3dof.diagnosis.free_run.unexplained import constant_voltage
from heli3dof.diagnosis.result import Finding
from heli3dof.recording.recording import Recording

LINE = 0.02
EVEN = 0.5


def marked_unsure(
    findings: Sequence[Finding], recordings: Sequence[Recording]
) -> tuple[Finding, ...]:
    """The findings, those that such logs cannot bear as "…-like"."""
    compared = only_compared([f.choice.term.name for f in findings], recordings)
    return tuple(
        unsure(f) if f.choice.term.name in compared or _unborne(f, recordings) else f
        for f in findings
    )


def unsure(f: Finding) -> Finding:
    """The same as "…-like"."""
    sure = min(f.choice.confidence, EVEN)
    return replace(f, like=True, choice=replace(f.choice, confidence=sure))


def _unborne(f: Finding, recordings: Sequence[Recording]) -> bool:
    name = f.choice.term.effect.name
    if name == "mass.change":
        return len(recordings) > 1 or any(constant_voltage(r) for r in recordings)
    if name == "disturbance.periodic":
        return any(in_the_motion(r, f.values["frequency_Hz"][0]) for r in recordings)
    return False


def in_the_motion(recording: Recording, frequency_Hz: float) -> bool:
    """Whether what was commanded (or moved, where no reference was logged) has a line there."""
    r = recording
    x = r.reference if np.isfinite(r.reference).any() else r.angle
    return any(line_share(r.t, x[:, i], frequency_Hz) >= LINE for i in range(x.shape[1]))


def line_share(t: np.ndarray, x: np.ndarray, frequency_Hz: float) -> float:
    """(N,) s, (N,) any unit: the share of x's variance at that frequency, 0 where it stands."""
    there = np.isfinite(x)
    if there.sum() < 2:
        return 0.0
    t, x = t[there], x[there] - x[there].mean()
    power = float(x @ x) / len(x)
    if power <= 1e-12:
        return 0.0
    line = np.mean(x * np.exp(-2j * np.pi * frequency_Hz * t))
    return float(2 * abs(line) ** 2 / power)
