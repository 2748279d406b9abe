"""Draw predictions of the models "before" and "after" over one stretch of the held-out data.

"Before" is the refitted model without the causes, "after" the model with the causes. The held-out
data are divided into stretches of `CELL_S` seconds (`heli3dof.diagnosis.validation.gain`). E is the
RMSE of predictions 1 s ahead on one axis in one stretch. The "worst" stretch and axis, which are
drawn, have the largest ratio E_before / median(E_after). The median runs over all stretches, on the
same axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.validation.gain import CELL_S, HORIZON_S, HeldOut, rms_deg
from heli3dof.report.figures.labelled_curves import Curve, angle_figure
from heli3dof.report.figures.style import EXTENDED, MEASURED, SYMBOLS, VERMILION, Line
from heli3dof.report.text.number_format import fixed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BEFORE = Line(VERMILION, 1.5, (6, 1.5), 5)


@dataclass(frozen=True)
class Stretch:
    """A stretch of `CELL_S` s of the held-out data, with the RMSE of two models on one axis.

    ``before_deg`` is the RMSE of the refitted model without the causes, ``after_deg`` that of the
    model with the causes. Times are on the log's clock.
    """

    source: int
    """Index of the recording"""
    start_s: float
    stop_s: float
    axis: str
    before_deg: float
    after_deg: float


def worst_stretch(before: HeldOut, after: HeldOut) -> Stretch | None:
    """Return the stretch and axis on which the model without the causes is worst.

    ``before``: the prediction errors of the refitted model without the causes. ``after``: those of
    the model with the causes. The stretch has the largest ratio of two RMSEs. The numerator is the
    RMSE without the causes in this stretch. The denominator is the median over all stretches of the
    RMSE with the causes, on the same axis. The result is None if no ratio is defined.
    """
    e_before, e_after = (
        np.ma.masked_invalid(rms_deg(x.squares, x.counts)) for x in (before, after)
    )
    ratio = e_before / np.ma.median(e_after, axis=0)  # type: ignore[no-untyped-call]
    if not ratio.count():
        return None
    cell, i = np.unravel_index(int(ratio.argmax()), ratio.shape)
    start_s = float(before.start_s[cell])
    return Stretch(
        int(before.source[cell]), start_s, start_s + CELL_S, AXES[int(i)],
        float(e_before[cell, i]), float(e_after[cell, i]),
    )  # fmt: skip


def stretch_figure(before: HeldOut, after: HeldOut, worst: Stretch, recording: str = "") -> Figure:
    """Draw 1 s predictions over the stretch ``worst``; ``recording``: its name, for the title."""
    i = AXES.index(worst.axis)
    c = before.course
    margin = 0.5 * (worst.stop_s - worst.start_s)
    rows = c.source == worst.source
    rows &= (c.t >= worst.start_s - margin) & (c.t <= worst.stop_s + margin)
    order = np.argsort(c.t[rows])

    def drawn(label: str, y: np.ndarray, line: Line) -> Curve:
        return Curve(label, c.t[rows][order], np.degrees(y[rows][order, i]), line)

    unseen = "held-out recording" if before.on == "holdout" else "left-out block"
    curves = [
        drawn("measured", c.measured, MEASURED),
        drawn("before", c.predicted, BEFORE),
        drawn("after", after.course.predicted, EXTENDED),
    ]
    name = f" · {recording}" if recording else ""
    return angle_figure(
        curves,
        title=f"Worst stretch of {worst.axis}, before and after{name}",
        subtitle=f"{HORIZON_S:g} s predictions, {unseen}; RMSE from {worst.start_s:.1f} to "
        f"{worst.stop_s:.1f} s: before {fixed(worst.before_deg, 2, '°')}, "
        f"after {fixed(worst.after_deg, 2, '°')}",
        ylabel=f"{worst.axis} {SYMBOLS[worst.axis]} (°)",
        frame=("measured",),
    )
