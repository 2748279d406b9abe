"""Draw the evidence for a cause: residual torque over the variable on which the cause depends.

Points are the residual torque of the model without the cause, with error bars of one standard
error. The line is the cause's torque as fitted to the innovations of the Kalman filter, not to the
points.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from heli3dof.report.figures.labelled_curves import headline
from heli3dof.report.figures.style import EXTENDED, GRID, INK, RC, SOFT, plain
from heli3dof.report.figures.torque_curve import TorqueCurve
from heli3dof.report.text.diagnosis_sentences import variable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOM = 1.35
"""Ratio of a figure's vertical range to the range of the measured points in it (a convention)"""


def evidence_figure(e: TorqueCurve) -> Figure:
    """Draw the residual torque ``e`` over its variable, and the fitted torque of the cause."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(RC):
        height = 3.6
        figure = Figure(figsize=(6.4, height))
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
        headline(figure, f"{e.name} in the residual torque", height)
        text = "Residual torque of the model without this cause, mean of bins ± one standard error"
        figure.text(0.015, 1 - 0.46 / height, plain(text), fontsize=8.5, color=SOFT, va="center")
    return figure


def evidence_alt(e: TorqueCurve) -> str:
    """Return the alternative text of `evidence_figure`."""
    return f"Residual {e.axis} torque against {e.depends_on}, with {e.name} as fitted"
