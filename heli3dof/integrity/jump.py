"""Report a change of many counts within one sample, faster than any arm can move.

Row k has the angle q_k and the sample number n_k, which also counts lost samples. Let
Δ_k = n_k − n_{k−1} and d_k = (q_k − q_{k−1})/Δ_k. d̄_k is the mean of d_{k−1} and d_{k+1}. dt is the
sampling period in s. Step k is a jump if

    min(|d_k − d̄_k|, |d_k|) Δ_k > max(`COUNTS` counts, `ANGLE`, `RATE` Δ_k dt)

An impact changes the rate by 150°/s at most; at 500 Hz, |d_k − d̄_k| is then a tenth of `ANGLE`. If
the angle was constant for `STOOD_S` before the jump, the encoder was frozen or its counter was
reset.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heli3dof.axes import AXES
from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.remedies import column_of, is_log
from heli3dof.integrity.view import View
from heli3dof.recording.logs.known_names import IMPORT, as_options, operand
from heli3dof.recording.recording import Recording

COUNTS = 16
ANGLE = np.radians(1.5)
RATE = np.radians(600.0)
"""rad/s; see the module. Chosen, as are all constants here."""
FEW = 20
"""Above this number of jumps the angle may have another unit."""
WRAP = np.radians(5.0)
"""rad: a jump this close to 180° or 360° is a wrapped angle."""
STOOD_S = 0.4


def deviations(view: View, i: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the deviation of each step (N − 1,) in rad, and the indices of the jumps among them.

    ``i``: index of the axis, 0 to 2. A step is the change of the angle from one row to the next. It
    spans Δ sampling periods, and the change per period is d. d̄ is the mean d of the step before
    and the step after. The deviation is min(|d − d̄|, |d|) Δ. A jump is a step whose deviation
    exceeds the limit in the module's docstring.
    """
    r = view.recording
    change = np.diff(r.angle[:, i])
    n = np.maximum(np.diff(view.sampling_clock.number), 1)
    d = np.where(np.isfinite(change), change, 0.0) / n
    if len(d) < 5:
        return np.zeros_like(d), np.empty(0, dtype=np.int64)
    mean_neighbours = np.empty_like(d)
    mean_neighbours[1:-1] = 0.5 * (d[2:] + d[:-2])
    mean_neighbours[0], mean_neighbours[-1] = d[1], d[-2]
    # Next to a one-sample spike, d̄ contains the spike: there |d| is the smaller one.
    deviation = np.minimum(np.abs(d - mean_neighbours), np.abs(d)) * n
    counts = COUNTS * abs(float(r.profile.encoder.rad_per_count[i]))
    limit = np.maximum(max(counts, ANGLE), RATE * r.dt * n)
    return deviation, np.flatnonzero(deviation > limit)


def jumps(view: View) -> Iterable[Fault]:
    r = view.recording
    for i in view.measured:
        change = np.diff(r.angle[:, i])
        deviation, at = deviations(view, i)
        if not len(at):
            continue
        k = int(at[np.argmax(deviation[at])])
        size = float(change[k])
        turn = next((w for w in (360, 180) if abs(abs(size) - np.radians(w)) < WRAP), None)
        back = k + 1 < len(change) and abs(change[k] + change[k + 1]) < 0.5 * abs(size)
        moved = np.flatnonzero(change[:k] != 0)
        first = int(moved[-1]) + 1 if len(moved) else 0  # from here on, one count until row k
        froze = not back and turn is None and r.t[k] - r.t[first] >= STOOD_S
        times = f"{len(at)} times, at most" if len(at) > 1 else "once,"
        yield Fault(
            "encoder.jump", Kind.BAD_DATA, r.name,
            f"{r.name}: {AXES[i]} jumps {times} by {np.degrees(size):+.4g}° within one sample (at "
            f"{r.t[k + 1]:.4g} s)" + (
                " and returns." if back else
                f", after staying on one count from {r.t[first]:.4g} s on." if froze else "."
            ),
            f"the angle is wrapped to {turn}°." if turn else
            "a transmission error on the link." if back else
            "the encoder was frozen until then (its cable, its input on the card, or a log that "
            "repeats an old value); or the axis rested and the counter was reset." if froze else
            "the counter was reset or lost counts: all later angles are wrong.",
            _unwrapping(r, AXES[i], turn) if turn else
            "remove the row (gaps in time are allowed)" if back else
            "use the data before or after: "
            f"recording.between(0, {r.t[first if froze else k]:.4g})",
            axis=AXES[i],
        )  # fmt: skip


def _unwrapping(recording: Recording, axis: str, turn: int) -> str:
    """Return, as text, how to unwrap an angle that is wrapped to ``turn`` degrees.

    For an imported log the text is a ``--map`` option, else a call of ``numpy.unwrap``.
    """
    if not is_log(recording):
        return f"unwrap it: numpy.unwrap(angle_deg, period={turn})"
    column, angle = column_of(recording, axis)
    whole = f"unwrap({angle})" if turn == 360 else f"unwrap(2*{operand(angle)})/2"
    return f"unwrap it: {IMPORT} {as_options({column: whole})}"


CHECKS = (Check("encoder.jump", Stage.MOTION, "many counts within one sample", jumps),)
