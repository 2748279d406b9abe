"""Draw a diagnosis: its prediction errors by axis, and the evidence for each cause.

The evidence is the residual torque against the variable on which the cause depends. Points are the
residual torque of the model without the cause, with error bars of one standard error. The line is
the cause's torque as fitted to the innovations of the Kalman filter, not to the points.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from heli3dof.axes import AXES
from heli3dof.diagnosis.result import Diagnosis
from heli3dof.diagnosis.validation.gain import HORIZON_S
from heli3dof.errors import UsageError
from heli3dof.report.figures.style import EXTENDED, GRID, INK, SOFT, new_figure, plain
from heli3dof.report.figures.torque_curve import TorqueCurve
from heli3dof.report.text.diagnosis_sentences import number, variable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOM = 1.35
"""Ratio of a figure's vertical range to the range of zero, the measured points and their error bars
(a convention)"""


def diagnosis_figure(found: Diagnosis) -> Figure:
    """Draw for each axis the RMSE (°) of predictions `HORIZON_S` s ahead, as three bars.

    - "refitted simulation": RMSE of the fitted model without the causes
    - "extended model": RMSE of the fitted model with the causes
    - "noise floor": RMSE that noise would cause even if the model were correct

    The models predict data to which they were not fitted. Only a diagnosis with ``quick=True`` may
    have used the fitted data instead. Raises UsageError if the recordings could not be fitted.
    """
    f = found.fitted
    if f is None:
        raise UsageError(
            "There is no figure of this diagnosis.",
            cause=f"its verdict is {found.verdict}: nothing was fitted.",
            fix="print its summary()",
        )
    bars = {
        "refitted simulation": (f.gain.before, INK),
        "extended model": (f.gain.after, EXTENDED.color),
        "noise floor": (f.noise_floor, SOFT),
    }
    height = 3.6
    title = f"Errors of {HORIZON_S:g} s predictions: {found.verdict}"
    with new_figure(6.4, height, title) as figure:
        axes = figure.add_axes((0.125, 0.35 / height, 0.845, (height - 0.35 - 0.5) / height))
        for n, (label, (error, color)) in enumerate(bars.items()):
            x = [i + 0.27 * (n - 1) for i in range(len(AXES))]
            y = [number(error.get(axis)) for axis in AXES]
            axes.bar(x, y, width=0.25, color=color, label=label)
        axes.set_xticks(range(len(AXES)), AXES)
        axes.set_ylabel("RMSE (°)")
        axes.legend(loc="best", fontsize=8.5)
    return figure


def evidence_figure(e: TorqueCurve) -> Figure:
    """Draw the evidence for a cause: a torque against the variable on which the cause depends.

    The points show the residual torque of the model without this cause. The line shows the torque
    of the fitted cause. ``e`` contains both.
    """
    height = 3.6
    with new_figure(6.4, height, f"{e.name} in the residual torque") as figure:
        axes = figure.add_axes((0.125, 0.53 / height, 0.845, (height - 0.53 - 0.72) / height))
        axes.axhline(0.0, color=GRID, linewidth=1.4, zorder=1)
        axes.errorbar(
            e.z, e.torque, yerr=e.std, fmt="o", color=INK, markersize=4.2, elinewidth=1.1,
            capsize=2.5, zorder=4, label="measured",
        )  # fmt: skip
        axes.plot(e.curve_z, e.curve, label="fitted cause", **EXTENDED.kwargs())
        low = float(min(0.0, (e.torque - e.std).min()))
        high = float(max(0.0, (e.torque + e.std).max()))
        middle, half = 0.5 * (low + high), 0.5 * ROOM * max(high - low, 1e-9)
        axes.set_ylim(middle - half, middle + half)
        axes.set_xlabel(f"{variable(e.depends_on)} ({e.unit})")
        axes.set_ylabel(f"residual {e.axis} torque (N·m)")
        axes.legend(loc="best", fontsize=8.5)
        text = "Residual torque of the model without this cause, mean of bins ± one standard error"
        figure.text(0.015, 1 - 0.46 / height, plain(text), fontsize=8.5, color=SOFT, va="center")
    return figure


def evidence_alt(e: TorqueCurve) -> str:
    """Return the alternative text of `evidence_figure`."""
    return f"Residual {e.axis} torque against {e.depends_on}, with {e.name} as fitted"
