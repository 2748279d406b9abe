"""Report two swapped columns of a log, from the motion, the encoder's grid or the references.

The check has three methods: motion, grid and references. It uses them in this order, until one of
them finds a swap.

**Motion.** `response` fits a model of the motion to each axis. It estimates the response g: the
acceleration that the voltages cause, divided by the profile's prediction. R² is the coefficient of
determination of this fit. An axis is

* *driven* if the predicted acceleration (`Response.drive`) exceeds `DRIVEN`;
* *consistent* if |g| is within `RANGE`, |g| exceeds `SURE` standard deviations, R² > `EXPLAINED`;
* *inconsistent* if it is driven, and |g| is outside `RANGE` or R² < `UNEXPLAINED`.

The check first selects axes. Normally, it selects the inconsistent axes. If a voltage's column is
constant, the column may contain another signal, such as a constant reference. Then the check
selects all driven axes.

The check then exchanges two columns of the log at a time. The columns are the angles, the voltages,
and the references that are not constant. The check tries these pairs:

* the angle of a selected axis, and any other column;
* one voltage, and any column except the other voltage. Swapped motors have the effect of a wrong
  sign, and `directions` reports them.

A pair is a candidate if the exchange has both of these effects:

* At least one selected axis becomes consistent, and the R² of this axis increases.
* No other axis becomes inconsistent.

M measures how well a log agrees with the profile. It is a sum over the driven axes:

    M = Σ R² exp(−½ (ln |g|)² / `USUAL`²)

The check reports the candidate with the largest M if both of these hold:

* The exchange increases M by at least `BETTER`.
* A change of one voltage's sign, without the exchange, does not give a larger M.

**Grid.** The grid of an encoder consists of the multiples of one count. The check reports an angle
and a reference as swapped if only the reference is on the grid of the angle's encoder.

**References.** The check reports the references of two axes a and b as swapped if axis a follows
the reference of b. ρ is the correlation of an angle and a reference in flight:

    ρ(a, ref_b) > `FOLLOWS`,   ρ(a, ref_a) < `IGNORES`,   ρ(b, ref_b) < `IGNORES`
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from heli3dof.axes import AXES, MOTORS
from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.response import Response
from heli3dof.integrity.view import View
from heli3dof.recording.logs.angle_units import on_grid
from heli3dof.recording.recording import Recording

RANGE, SURE = (0.3, 3.3), 4.0
"""Of a consistent axis: range of |g|, least |g| in standard deviations. All limits are chosen."""
EXPLAINED, UNEXPLAINED = 0.5, 0.4
USUAL, BETTER = 0.5, 0.3
STEP_S = 0.008
DRIVEN = 0.025
"""rad/s²: below this drive, friction and noise affect the response."""
FOLLOWS, IGNORES = 0.7, 0.3
ANGLE, VOLTAGE, REFERENCE = range(3), range(3, 5), range(5, 8)
COLUMNS = (
    *(f"{axis}_deg" for axis in AXES),
    *(f"v_{motor}_V" for motor in MOTORS),
    *(f"{axis}_ref_deg" for axis in AXES),
)
TITLES = (
    *AXES,
    *(f"the {motor} motor's voltage" for motor in MOTORS),
    *(f"{axis}'s reference" for axis in AXES),
)
"""`COLUMNS`, `TITLES`: names of the columns of `_table`, in a log and in a message"""
LEVELS = 8
"""Least number of distinct values of a reference on an encoder's grid"""


class Swap(NamedTuple):
    """Two columns that are swapped in a log (indices of `COLUMNS`), and the evidence as text."""

    a: int
    b: int
    evidence: str


def columns(view: View) -> Iterable[Fault]:
    """Yield a fault if two columns are swapped."""
    swap = swap_by_motion(view) or _swap_by_grid(view) or _swap_by_reference(view)
    if swap is None:
        return
    a, b, evidence = swap
    r = view.recording
    yield Fault(
        "columns.swapped", Kind.BAD_DATA, r.name,
        f"{r.name}: {TITLES[a]} and {TITLES[b]} are swapped: {evidence}.",
        "the names of two columns are swapped, or two channels are wired the wrong way.",
        f"swap the names {COLUMNS[a]} and {COLUMNS[b]} in the log's header line"
        + (", or the two encoders' plugs" if {a, b} <= {*ANGLE} else " and import it again"),
        axis=AXES[a] if a in ANGLE else None, confidence=0.99,
    )  # fmt: skip


def is_consistent(x: Response) -> bool:
    """Return True if an axis' response to the voltages shows no swapped column.

    The response must have a plausible size, be significant, and explain the motion.
    """
    return _gain_in_range(x) and abs(x.t) > SURE and x.explained > EXPLAINED


def inconsistent(responses: dict[str, Response]) -> set[str]:
    """Return the axes that the voltages drive, but whose motion the voltages do not explain.

    ``responses``: {axis: its response g to the voltages}. g is the acceleration that the voltages
    cause, divided by the profile's prediction.
    """
    driven = {a: x for a, x in responses.items() if x.drive > DRIVEN}
    return {a for a, x in driven.items() if x.explained < UNEXPLAINED or not _gain_in_range(x)}


def _gain_in_range(x: Response) -> bool:
    return RANGE[0] < abs(x.gain) < RANGE[1]


def agreement(responses: dict[str, Response]) -> float:
    """Return M, which measures how well a log agrees with the profile; it is at most 3.

    ``responses``: {axis: its response g to the voltages}. g is the acceleration that the voltages
    cause, divided by the profile's prediction. R² is the share of the axis' motion that the fit of
    g explains. An axis is driven if the predicted acceleration exceeds `DRIVEN`. M is a sum over
    the driven axes:

        M = Σ R² exp(−½ (ln |g|)² / `USUAL`²)
    """
    driven = (x for x in responses.values() if x.drive > DRIVEN and x.gain != 0)
    return float(
        sum(x.explained * np.exp(-0.5 * (np.log(abs(x.gain)) / USUAL) ** 2) for x in driven)
    )


def axes_to_explain(view: View, T: np.ndarray) -> set[str]:
    """Return the axes whose motion may show swapped columns: the `inconsistent` ones.

    If a voltage is constant, its column may contain another signal. Then the function returns all
    axes that the voltages drive.
    ``T``: the recording's columns as a table (`_table`).
    """
    V = np.nan_to_num(T[:, VOLTAGE])
    if (np.ptp(V, axis=0) == 0).any():
        return {a for a, x in view.responses.items() if x.drive > DRIVEN}
    return inconsistent(view.responses)


def swap_by_motion(view: View) -> Swap | None:
    """Return the two columns that are swapped, judged by the axes' motion; else None.

    The function exchanges two columns of the log at a time, and compares the resulting motion with
    the profile's prediction. It returns the two columns whose exchange leads to the best agreement
    (`agreement`). The result is None if the exchange increases the agreement by less than `BETTER`.
    It is also None if a change of one voltage's sign leads to a better agreement. The module's
    docstring lists further conditions.
    """
    if not axes_to_explain(view, _table(view.recording)):
        return None
    view = View(block_means(view.recording))
    r, T = view.recording, _table(view.recording)
    bad = axes_to_explain(view, T)
    candidates: list[tuple[float, int, int, dict[str, Response], set[str]]] = []
    for a, b in _pairs(T, bad):
        other = View(_swapped(r, T, a, b)).responses
        touched = set(bad) if {a, b} & {*VOLTAGE} else _names(a, b)
        right = {
            x for x in touched & bad
            if x in other and is_consistent(other[x])
            and other[x].explained > view.responses[x].explained
        }  # fmt: skip
        if right and inconsistent(other) <= bad - right:
            candidates.append((agreement(other), a, b, other, right))
    if not candidates:
        return None
    best, a, b, other, right = max(candidates, key=lambda f: f[0])
    mirrored = (View(replace(r, voltage=r.voltage * s)) for s in ((-1, 1), (1, -1)))
    others = (agreement(v.responses) for v in mirrored)
    if best < agreement(view.responses) + BETTER or any(x > best for x in others):
        return None
    axis = next(x for x in AXES if x in right)
    was, now = view.responses[axis], other[axis]
    return Swap(
        a, b,
        f"as logged, {axis}'s response to its voltages is {was.gain:+.2g} ± {was.std:.1g} times "
        f"the profile's (R² {was.explained:.2f}); swapped back, {now.gain:+.2g} ± {now.std:.1g} "
        f"(R² {now.explained:.2f})",
    )  # fmt: skip


def block_means(r: Recording) -> Recording:
    """Return the means of times, voltages, angles and references over blocks of `STEP_S` s.

    `heli3dof.integrity.response` is faster on these means than on all samples, and equally
    accurate.
    """
    m = max(1, round(STEP_S / r.dt)) if len(r) > 1 else 1
    n = len(r) // m

    def mean(x: np.ndarray) -> np.ndarray:
        return np.asarray(x[: n * m].reshape(n, m, *x.shape[1:]).mean(axis=1))

    first = r.rows(slice(0, n * m, m))
    return replace(
        first, t=mean(r.t), voltage=mean(r.voltage), angle=mean(r.angle),
        reference=mean(r.reference),
    )  # fmt: skip


def _pairs(T: np.ndarray, bad: set[str]) -> Iterator[tuple[int, int]]:
    """Yield the pairs of columns whose swap may explain the motion of the axes ``bad``.

    Each pair contains a voltage, or the angle of an axis in ``bad``. The pair of the two voltages
    is left out. A column is given as its index in the table ``T`` (`_table`).
    """
    present = [c for c in range(T.shape[1]) if np.isfinite(T[:, c]).any()]
    for a, b in combinations(present, 2):
        moves = np.nanmax(T[:, b]) > np.nanmin(T[:, b]) or b not in REFERENCE
        voltage = {a, b} & {*VOLTAGE}
        if moves and {a, b} != {*VOLTAGE} and (voltage or _names(a, b) & bad):
            yield a, b


def _names(*columns: int) -> set[str]:
    return {AXES[c] for c in columns if c in ANGLE}


def _swap_by_grid(view: View) -> Swap | None:
    """Return an angle and a reference that are swapped, judged by the encoder's grid; else None.

    The grid of an angle consists of the multiples of its encoder's step. The function reports an
    angle and a reference as swapped if the reference is on the angle's grid and the angle is not.
    """
    r, rows = view.recording, view.finite_rows
    if rows.sum() < 100:
        return None
    for i in view.measured:
        step = abs(float(r.profile.encoder.rad_per_count[i]))
        if on_grid(r.angle[rows, i], step):
            continue
        for j, axis in enumerate(AXES):
            ref = r.reference[rows, j]
            if np.isfinite(ref).all() and on_grid(ref, step, levels=LEVELS):
                return Swap(
                    i, 5 + j,
                    f"{AXES[i]} is not on its encoder's grid, but {axis}'s reference has the "
                    f"encoder's steps of {np.degrees(step):.3g}°",
                )  # fmt: skip
    return None


def _swap_by_reference(view: View) -> Swap | None:
    """Return the references of two axes that are swapped, judged by correlation; else None.

    The function reports the references of two axes as swapped if both of these hold: the angle of
    one axis follows the reference of the other axis, and neither angle follows its own reference.
    """
    r, rows = view.recording, view.flying
    both = [i for i in view.measured if np.isfinite(r.reference[rows, i]).all()]
    if rows.sum() < 100:
        return None
    rho = np.zeros((3, 3))
    for a in both:
        for b in both:
            x, y = r.angle[rows, a], r.reference[rows, b]
            if np.nanstd(x) > 0 and np.std(y) > 0:
                rho[a, b] = np.corrcoef(np.nan_to_num(x), y)[0, 1]
    for a, b in ((a, b) for a in both for b in both if a != b):
        if rho[a, b] > FOLLOWS and max(rho[a, a], rho[b, b]) < IGNORES:
            first, last = sorted((a, b))
            return Swap(
                5 + first, 5 + last,
                f"{AXES[a]} follows {AXES[b]}'s reference (correlation {rho[a, b]:.2f}), not its "
                f"own ({rho[a, a]:.2f})",
            )  # fmt: skip
    return None


def _table(r: Recording) -> np.ndarray:
    """Return the angles (°), voltages (V) and references (°) as a table (N, 8)."""
    return np.column_stack([np.degrees(r.angle), r.voltage, np.degrees(r.reference)])


def _swapped(r: Recording, T: np.ndarray, a: int, b: int) -> Recording:
    order = np.arange(T.shape[1])
    order[[a, b]] = b, a
    X = T[:, order]
    return replace(r, angle=np.radians(X[:, :3]), voltage=X[:, 3:5], reference=np.radians(X[:, 5:]))


CHECKS = (Check("columns.swapped", Stage.COLUMNS, "two swapped columns", columns),)
