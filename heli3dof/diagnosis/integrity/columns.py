"""Is each column what its name says? Two that were exchanged are told by the motion.

An axis answers its own voltages g times as strongly as the profile says (`response`): roll their
sum, pitch their difference, yaw their sum tilted by pitch. It *fits* where |g| is within `RANGE`,
is `SURE` standard deviations from zero and explains a share R² > `EXPLAINED` of the motion; it is
*unfit* where the voltages push it and |g| is not, or R² < `UNEXPLAINED`. Where an axis is unfit
each exchange of two columns is tried that touches it; one is the cause if

    the exchanged angle, or with a voltage some axis, is unfit as logged,
    fits once exchanged back, and no other axis becomes unfit thereby, and
    M = Σ R² exp(−½ (ln |g| / `USUAL`)²) over the axes pushed is larger by `BETTER`;

of several the one with the largest M, where no other sign of a voltage does better. Where one
voltage stands still every axis is suspect.

An axis that is not pushed (yaw of a plain step) says nothing. Then an angle that is on no grid,
while a reference is on its encoder's, is told by that.

A reference belongs to an axis that follows it, by their correlation ρ over the flight:

    ρ(a, ref_b) > `FOLLOWS`,   ρ(a, ref_a) < `IGNORES`,   ρ(b, ref_b) < `IGNORES`

(ρ of something that stands still is zero): then references a and b are exchanged. Front and back
for each other are `directions`' business, as they look like a sign.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from heli3dof.axes import AXES, MOTORS
from heli3dof.diagnosis.integrity.base import Check, Fault, Kind, Stage
from heli3dof.diagnosis.integrity.response import Response
from heli3dof.diagnosis.integrity.view import View
from heli3dof.recording.logs.angle_units import on_grid
from heli3dof.recording.recording import Recording

RANGE, SURE = (0.3, 3.3), 4.0
EXPLAINED, UNEXPLAINED = 0.5, 0.4
USUAL, BETTER = 0.5, 0.3
STEP_S = 0.008
PUSHED = 0.025
"""rad/s²: an axis that is driven less answers friction and noise as well."""
FOLLOWS, IGNORES = 0.7, 0.3
ANGLE, VOLTAGE, REFERENCE = range(3), range(3, 5), range(5, 8)
NAMES = (*AXES, *(f"v_{m}" for m in MOTORS), *(f"{a}_ref" for a in AXES))
"""Of the columns of `_table`."""
LEVELS = 8


def columns(view: View) -> Iterable[Fault]:
    """Two columns that are exchanged."""
    found = _by_motion(view) or _by_encoder(view) or _by_reference(view)
    if found is None:
        return
    a, b, why = found
    r = view.recording
    yield Fault(
        "columns.swapped", Kind.BAD_DATA, r.name,
        f"{r.name}: {_title(a)} and {_title(b)} are swapped: {why}.",
        "the names of two columns are swapped, or two channels are wired the wrong way.",
        f"swap the names {_column(a)} and {_column(b)} in the log's header line and import it again"
        if a not in ANGLE or b not in ANGLE else
        f"swap the names {_column(a)} and {_column(b)} in the log's header line, or the two "
        "encoders' plugs",
        axis=AXES[a] if a in ANGLE else None, confidence=0.99,
    )  # fmt: skip


def _title(column: int) -> str:
    if column in ANGLE:
        return AXES[column]
    if column in VOLTAGE:
        return f"the {MOTORS[column - 3]} motor's voltage"
    return f"{AXES[column - 5]}'s reference"


def _column(column: int) -> str:
    return f"{NAMES[column]}_{'V' if column in VOLTAGE else 'deg'}"


def fits(x: Response) -> bool:
    """Whether the axis answers its voltages about as the profile says, one way or the other."""
    return _sized(x) and abs(x.t) > SURE and x.explained > EXPLAINED


def unfit(answers: dict[str, Response]) -> set[str]:
    """Axes that are pushed and do not answer."""
    pushed = {a: x for a, x in answers.items() if x.drive > PUSHED}
    return {a for a, x in pushed.items() if x.explained < UNEXPLAINED or not _sized(x)}


def _sized(x: Response) -> bool:
    return RANGE[0] < abs(x.gain) < RANGE[1]


def merit(answers: dict[str, Response]) -> float:
    """M: how well the axes that are pushed obey the profile."""
    pushed = (x for x in answers.values() if x.drive > PUSHED and x.gain != 0)
    return float(
        sum(x.explained * np.exp(-0.5 * (np.log(abs(x.gain)) / USUAL) ** 2) for x in pushed)
    )


def suspects(view: View, T: np.ndarray) -> set[str]:
    """Axes that are unfit; every one that is pushed, where one voltage stands still."""
    V = np.nan_to_num(T[:, VOLTAGE])
    if (np.ptp(V, axis=0) == 0).any():
        return {a for a, x in view.responses.items() if x.drive > PUSHED}
    return unfit(view.responses)


def _by_motion(view: View) -> tuple[int, int, str] | None:
    if not suspects(view, _table(view.recording)):
        return None
    view = View(coarser(view.recording))
    r, T = view.recording, _table(view.recording)
    bad = suspects(view, T)
    found: list[tuple[float, int, int, dict[str, Response], set[str]]] = []
    for a, b in _exchanges(T, bad):
        other = View(_exchanged(r, T, a, b)).responses
        touched = set(bad) if {a, b} & {*VOLTAGE} else _names(a, b)
        right = {x for x in touched & bad if x in other and fits(other[x])}
        if right and unfit(other) <= bad - right:
            found.append((merit(other), a, b, other, right))
    if not found:
        return None
    best, a, b, other, right = max(found, key=lambda f: f[0])
    turned = (View(replace(r, voltage=r.voltage * s)) for s in ((-1, 1), (1, -1)))
    if best < merit(view.responses) + BETTER or any(merit(v.responses) > best for v in turned):
        return None
    axis = next(x for x in AXES if x in right)
    was, now = view.responses[axis], other[axis]
    return a, b, (
        f"as logged, {axis}'s response to its voltages is {was.gain:+.2g} ± {was.std:.1g} times "
        f"the profile's (R² {was.explained:.2f}); swapped back, {now.gain:+.2g} ± {now.std:.1g} "
        f"(R² {now.explained:.2f})"
    )  # fmt: skip


def coarser(r: Recording) -> Recording:
    """Means over `STEP_S`, of which the windows of `response` hold dozens: it is quicker."""
    m = max(1, round(STEP_S / r.dt)) if len(r) > 1 else 1
    n = len(r) // m

    def mean(x: np.ndarray) -> np.ndarray:
        return np.asarray(x[: n * m].reshape(n, m, *x.shape[1:]).mean(axis=1))

    some = r.rows(slice(0, n * m, m))
    return replace(
        some, t=mean(r.t), voltage=mean(r.voltage), angle=mean(r.angle),
        reference=mean(r.reference),
    )  # fmt: skip


def _exchanges(T: np.ndarray, bad: set[str]) -> Iterator[tuple[int, int]]:
    """Pairs of columns whose exchange may be why those axes are unfit."""
    read = [c for c in range(T.shape[1]) if np.isfinite(T[:, c]).any()]
    for a, b in combinations(read, 2):
        moves = np.nanmax(T[:, b]) > np.nanmin(T[:, b]) or b not in REFERENCE
        voltage = {a, b} & {*VOLTAGE}
        if moves and {a, b} != {*VOLTAGE} and (voltage or _names(a, b) & bad):
            yield a, b


def _names(*columns: int) -> set[str]:
    """The axes whose angles are among the columns."""
    return {AXES[c] for c in columns if c in ANGLE}


def _by_encoder(view: View) -> tuple[int, int, str] | None:
    """An angle that is none of its encoder's, while a reference moves as that encoder does."""
    r, rows = view.recording, view.read
    if rows.sum() < 100:
        return None
    for i in view.measured:
        step = abs(float(r.profile.encoder.rad_per_count[i]))
        if on_grid(r.angle[rows, i], step):
            continue
        for j, axis in enumerate(AXES):
            ref = r.reference[rows, j]
            if np.isfinite(ref).all() and on_grid(ref, step, levels=LEVELS):
                return i, 5 + j, (
                    f"{AXES[i]} is not on its encoder's grid, but {axis}'s reference has the "
                    f"encoder's steps of {np.degrees(step):.3g}°"
                )  # fmt: skip
    return None


def _by_reference(view: View) -> tuple[int, int, str] | None:
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
            return 5 + first, 5 + last, (
                f"{AXES[a]} follows {AXES[b]}'s reference (correlation {rho[a, b]:.2f}), not its "
                f"own ({rho[a, a]:.2f})"
            )  # fmt: skip
    return None


def _table(r: Recording) -> np.ndarray:
    """(N, 8) as a log has them: degrees and volts."""
    return np.column_stack([np.degrees(r.angle), r.voltage, np.degrees(r.reference)])


def _exchanged(r: Recording, T: np.ndarray, a: int, b: int) -> Recording:
    order = np.arange(T.shape[1])
    order[[a, b]] = b, a
    X = T[:, order]
    return replace(r, angle=np.radians(X[:, :3]), voltage=X[:, 3:5], reference=np.radians(X[:, 5:]))


CHECKS = (Check("columns.swapped", Stage.COLUMNS, "two swapped columns", columns),)
