"""``python -m tests.docs.pictures``: make the README's pictures in docs/pictures.

rig.svg draws the rig with its axes and names. cause.svg and terminal.svg come from one flight of
the emulated rig, with the commands that terminal.svg shows.
"""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.docs.tutorial import run
from tests.paths import ROOT

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FOLDER = ROOT / "docs" / "pictures"
SESSION = (
    "heli3dof run rich --device 'mock:?speed=max&seed=1&hide=stiffness.cable.yaw:0.1' "
    "-o cable.mcap --quiet",
    "heli3dof diagnose cable.mcap -o model.json",
    "heli3dof run-step --yaw 20 --device 'mock:?speed=max&seed=2&hide=stiffness.cable.yaw:0.1' "
    "-o step.mcap --quiet",
    "heli3dof compare step.mcap hover model.json",
)
HIDDEN_LINES = ("…", "Candidate: ", "The gain was", "To measure", "Model:", "Figures:", "For ", "·")
"""Beginnings and ends of lines that the picture of the terminal omits: progress, paths"""
COLUMNS = 110
L_A, L_W, L_H, HEIGHT = 1.0, 0.7, 0.32, 0.75
"""Lengths of the drawing: body and counterweight from the post, rotor from the arm, post"""
VIEW = np.array([[-0.82, 0.57, 0.0], [-0.22, -0.32, 0.92]])
"""(2, 3) projection of x (along the arm), y (towards the front motor), z (up) to the paper"""
INK, SOFT, BLUE, VERMILION, GREEN = "#1f2328", "#6e7781", "#0072B2", "#D55E00", "#009E73"


def make(folder: Path) -> None:
    """Write rig.svg, cause.svg and terminal.svg into ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.svg").write_text(rig(), encoding="utf-8")
    with tempfile.TemporaryDirectory() as name:
        outputs = [run(f"{command}\n", Path(name)) for command in SESSION]
        (folder / "terminal.svg").write_text(terminal(outputs), encoding="utf-8")
        (folder / "cause.svg").write_text(cause(Path(name) / "cable.mcap"), encoding="utf-8")


def terminal(outputs: list[str]) -> str:
    """Return the session as SVG: each command of `SESSION`, then the main lines that it printed."""
    from rich.console import Console
    from rich.text import Text

    console = Console(record=True, width=COLUMNS, file=io.StringIO(), highlight=False)
    for command, output in zip(SESSION, outputs, strict=True):
        console.print(Text.assemble(("$ ", "bold green"), (command, "bold")))
        lines = [
            line for line in output.splitlines()
            if not (line.startswith(HIDDEN_LINES) or line.endswith(HIDDEN_LINES))
        ]  # fmt: skip
        for line in lines:
            console.print(Text(line))
    return console.export_svg(title="heli3dof", unique_id="heli3dof")


def cause(recording: Path) -> str:
    """Return the figure of the hidden cause: the measured torque and the fitted curve."""
    import heli3dof as h3
    from heli3dof.report.figures.diagnosis import evidence_figure
    from heli3dof.report.figures.diagnosis_data import figure_data
    from heli3dof.report.figures.style import to_svg

    flight = h3.load(recording)
    (evidence, *_) = figure_data(h3.diagnose(flight), [flight], []).evidence
    return to_svg(evidence_figure(evidence))


def rig() -> str:
    """Return the drawing of the rig: its parts, its angles and their positive directions."""
    import matplotlib
    from matplotlib.figure import Figure

    from heli3dof.report.figures.style import RC, to_svg

    with matplotlib.rc_context(RC):
        figure = Figure(figsize=(7.2, 3.07))
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        axes.set_aspect("equal")
        axes.set_xlim(-1.95, 1.5)
        axes.set_ylim(-0.3, 1.17)
        top = np.array([0.0, 0.0, HEIGHT])
        body = top + np.array([L_A, 0, 0])
        weight = top - np.array([L_W, 0, 0])
        _line(axes, [[0, 0, 0], top], SOFT, 7)
        _disc(axes, np.zeros(3), 0.3, SOFT, 0.25)
        _line(axes, [weight, body], INK, 4)
        half = np.array([0, L_H, 0])
        _line(axes, [body - half, body + half], INK, 6)
        axes.plot(*(VIEW @ weight), "s", color=INK, markersize=17)
        for y, name in ((L_H, "front motor"), (-L_H, "back motor")):
            rotor = body + np.array([0, y, 0.06])
            _disc(axes, rotor, 0.2, BLUE, 0.35)
            _label(axes, rotor + np.array([0.42, 0.5 * np.sign(y), 0.0]), name, BLUE)
        _label(axes, weight + np.array([0, 0, 0.2]), "counterweight", INK)
        angle = np.linspace(0, 1, 30)
        lift = np.radians(24) * angle
        up = [top + (L_A + 0.42) * np.array([np.cos(a), 0, np.sin(a)]) for a in lift]
        _arrow(axes, up, VERMILION, "roll r (elevation)\npositive: body up", (-0.08, 0.04), "right")
        turn = np.radians(20 + 130 * angle)
        around = [top + np.array([0.3 * np.cos(a), 0.3 * np.sin(a), -0.35]) for a in turn]
        _arrow(
            axes, around, GREEN, "yaw ψ (travel)\npositive: counter-clockwise", (0.08, 0), "left"
        )
        tilt = np.radians(-15 + 70 * angle)
        about = [body + (L_H + 0.3) * np.array([0, np.cos(a), np.sin(a)]) for a in tilt]
        _arrow(axes, about, INK, "pitch p\npositive: front motor up", (0.06, 0.1), "left")
        return to_svg(figure)


def _line(axes: Axes, points: Any, color: str, width: float) -> None:
    x, y = VIEW @ np.array(points, dtype=float).T
    axes.plot(x, y, color=color, linewidth=width, solid_capstyle="round")


def _disc(axes: Axes, centre: np.ndarray, radius: float, color: str, alpha: float) -> None:
    a = np.linspace(0, 2 * np.pi, 60)
    ring = centre[:, None] + radius * np.array([np.cos(a), np.sin(a), 0 * a])
    axes.fill(*(VIEW @ ring), color=color, alpha=alpha, linewidth=0)


def _label(axes: Axes, at: np.ndarray, text: str, color: str) -> None:
    axes.text(*(VIEW @ at), text, color=color, ha="center", va="center", fontsize=10)


def _arrow(
    axes: Axes, path: list[Any], color: str, text: str, offset: tuple[float, float], align: str
) -> None:
    """Draw a curve with an arrow at its end, and its text at the end plus ``offset``."""
    x, y = VIEW @ np.array(path, dtype=float).T
    axes.plot(x[:-3], y[:-3], color=color, linewidth=2)
    axes.annotate(
        "", (x[-1], y[-1]), (x[-4], y[-4]),
        arrowprops={"arrowstyle": "-|>", "color": color, "linewidth": 2, "mutation_scale": 16},
    )  # fmt: skip
    place: Any = {"ha": align, "va": "center"}
    axes.text(x[-1] + offset[0], y[-1] + offset[1], text, color=color, fontsize=10, **place)


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
