"""A step of many counts within one sample: no arm turns that fast.

d_k = (q_k − q_{k−1}) / (n_k − n_{k−1}) is the change per sample; a jump is where it leaves the mean
of its neighbours' by more than `COUNTS` counts, `ANGLE` and `RATE` times the time between the two
samples: where a second is missing, an arm gets far. Impacts on the table or a stop change the
rate by 150°/s at most, a tenth of it at 500 Hz. Smaller losses (a few counts) cannot be told from
motion. An axis that stood on one count for `STOOD_S` before may have been frozen, and jumps to
where it really is; or it rested and its counter was reset: both are said.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.integrity.base import Check, Fault, Kind, Stage
from heli3dof.diagnosis.integrity.view import View

COUNTS = 16
ANGLE = np.radians(1.5)
RATE = np.radians(600.0)
FEW = 20
"""More jumps than this may be another unit."""
WRAP = np.radians(5.0)
STOOD_S = 0.4


def leaps(view: View, i: int) -> tuple[np.ndarray, np.ndarray]:
    """(N − 1,) rad, by how much each sample of axis i leaves its neighbours' motion, and the
    indices of those that do so by more than any arm could."""
    r = view.recording
    change = np.diff(r.angle[:, i])
    n = np.maximum(np.diff(view.ticks.number), 1)
    d = np.where(np.isfinite(change), change, 0.0) / n
    if len(d) < 5:
        return np.zeros_like(d), np.empty(0, dtype=np.int64)
    around = np.empty_like(d)
    around[1:-1] = 0.5 * (d[2:] + d[:-2])
    around[0], around[-1] = d[1], d[-2]
    # A spike's neighbours are its own return: take whichever is nearer.
    off = np.minimum(np.abs(d - around), np.abs(d)) * n
    counts = COUNTS * abs(float(r.profile.encoder.rad_per_count[i]))
    least = np.maximum(max(counts, ANGLE), RATE * r.dt * n)
    return off, np.flatnonzero(off > least)


def jumps(view: View) -> Iterable[Fault]:
    r = view.recording
    for i in view.measured:
        change = np.diff(r.angle[:, i])
        off, at = leaps(view, i)
        if not len(at):
            continue
        k = int(at[np.argmax(off[at])])
        size = float(change[k])
        turn = next((w for w in (360, 180) if abs(abs(size) - np.radians(w)) < WRAP), None)
        back = k + 1 < len(change) and abs(change[k] + change[k + 1]) < 0.5 * abs(size)
        first = _stood_from(view, i, k)
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
            "unwrap it: numpy.unwrap(angle)" if turn else
            "remove the row (gaps in time are allowed)" if back else
            "use the data before or after: "
            f"recording.between(0, {r.t[first if froze else k]:.4g})",
            axis=AXES[i],
        )  # fmt: skip


def _stood_from(view: View, i: int, k: int) -> int:
    """The first row of the stretch on one count that ends in row k."""
    moved = np.flatnonzero(np.diff(view.recording.angle[: k + 1, i]) != 0)
    return int(moved[-1]) + 1 if len(moved) else 0


CHECKS = (Check("encoder.jump", Stage.MOTION, "many counts within one sample", jumps),)
