"""Make the tables of a comparison: step metrics, prediction errors, Table II, paper's numbers.

A table is a `Grid`, which `heli3dof.report.text_table` renders.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from heli3dof.axes import AXES
from heli3dof.comparison.metrics import AxisMetrics, StepMetrics
from heli3dof.comparison.prediction import ConstantAngles
from heli3dof.comparison.result import (
    Comparison,
    FlightComparison,
    ModelComparison,
    PredictionError,
)
from heli3dof.paper.published import CAVEATS, NO_EXPERIMENT, Quantity, Subject, published
from heli3dof.paper.reproduction import Reproduced
from heli3dof.report.text_table import NONE, Grid, fixed, short, to_rich

if TYPE_CHECKING:
    from rich.console import RenderableType

EXPERIMENT = "experiment"
DIFFERENCE = "  Δ"
DELTA = "Δ: model minus experiment; the paper prints its magnitude."
QUANTITIES = {
    "peak": "peak",
    "error": "error",
    "peak_difference": "Δ peak",
    "error_difference": "Δ error",
}


def step_name(step: StepMetrics) -> str:
    """Return a reference segment as text, such as ``0 → 10° at 5 s`` or ``held at 0° from 5 s``."""
    when = short(step.start_s, " s")
    if step.kind in ("step", "start"):
        return f"{short(step.from_deg)} → {short(step.set_deg, '°')} at {when}"
    if step.kind == "hold":
        return f"held at {short(step.set_deg, '°')} from {when}"
    return "moving reference" if step.kind == "moving" else "no reference"


def metrics_table(flight: FlightComparison) -> Grid:
    """Return a table of the step metrics of experiment and models, and of their differences.

    The table describes one recording. Its last column is the RMSE of each model's closed-loop
    replay in degrees.
    """
    rows = []
    for i, axis in enumerate(AXES):
        measured = flight.experiment[axis].reported
        rows.append([axis, EXPERIMENT, *_metric_cells(measured.values()), NONE])
        for m in flight.models:
            if m.metrics is None:
                continue
            rmse = np.nan if m.replay_rmse_deg is None else m.replay_rmse_deg[i]
            ours = m.metrics[axis].reported.values()
            away = flight.difference(m, axis)
            rows.append([axis, m.name, *_metric_cells(ours), fixed(rmse)])
            if any(np.isfinite(v) for v in away.values()):
                rows.append([axis, DIFFERENCE, *_metric_cells(away, sign=True), ""])
    about = "; ".join(f"{axis} {step_name(flight.experiment[axis].reported)}" for axis in AXES)
    return Grid(
        f"Closed-loop replay · {flight.recording.name}",
        ["axis", "", *METRIC_HEADS, "RMSE °"],
        rows,
        notes=[
            f"Steps: {about}.",
            "Δ: model minus experiment. The paper prints the peak as overshoot. Here overshoot is "
            "peak minus set value (E10); on a held axis, the largest distance from the set value.",
            *_model_notes(flight),
        ],
        text_columns=2,
    )


METRIC_HEADS = ("peak °", "overshoot °", "overshoot %", "error °", "rise s", "settling s")


def metrics_of(metrics: Mapping[str, AxisMetrics], title: str) -> Grid:
    """Return a table of step metrics with the given title, a row per segment of each axis."""
    rows = [
        [axis, step_name(step), *_metric_cells(step.values())]
        for axis in AXES
        for step in metrics[axis].steps
        if step.kind != "none"
    ]
    return Grid(title, ["axis", "step", *METRIC_HEADS], rows, text_columns=2)


def _metric_cells(values: Mapping[str, float], *, sign: bool = False) -> list[str]:
    return [
        fixed(value, 1 if name == "overshoot_percent" else 2, sign=sign)
        for name, value in values.items()
    ]


def prediction_table(flight: FlightComparison) -> Grid | None:
    """Return a table of prediction RMSE (°) by axis, model and horizon; None if none was made."""
    if flight.constant_angles is None:
        return None
    horizons = list(flight.constant_angles.ahead_deg)
    window = flight.constant_angles.window_s
    rows = []
    for axis in flight.flown.axes:
        for m in flight.models:
            rows.append([axis, m.name, *_prediction_cells(m.prediction, axis, horizons)])
        held = _prediction_cells(flight.constant_angles, axis, horizons)
        rows.append([axis, ConstantAngles.name, *held])
    heads = [f"{h:g} s ahead" for h in horizons]
    return Grid(
        f"Multi-step prediction, RMSE in degrees · {flight.recording.name}",
        ["axis", "", *heads, f"over {window:g} s"],
        rows,
        notes=[
            "Each prediction starts from a state estimated up to then and uses the measured "
            "voltages. All models are evaluated on the same samples.",
            *([] if flight.why is None else [f"Not replayed: {flight.why}."]),
            *([] if flight.why is None else _model_notes(flight)),
        ],
        text_columns=2,
    )


def _prediction_cells(
    error: PredictionError | None, axis: str, horizons: Sequence[float]
) -> list[str]:
    if error is None:
        return [NONE] * (len(horizons) + 1)
    i = AXES.index(axis)
    return [*(fixed(error.ahead_deg[h][i]) for h in horizons), fixed(error.over_window_deg[i])]


def table_ii(flight: FlightComparison) -> Grid | None:
    """Return a table like Table II of the paper, with the paper's numbers and this flight's.

    The numbers are |model − experiment| of the peak and of the steady error. The paper's word for
    the peak is overshoot (erratum E10). Returns None if the closed loop was not simulated with the
    recording's references.
    """
    if flight.why is not None:
        return None
    rows = []
    for axis in AXES:
        for m in flight.models:
            subject = _subject(m, flight.models)
            difference = flight.difference(m, axis)
            peak, error = difference["peak_deg"], difference["steady_error_deg"]
            rows.append(
                [
                    axis,
                    m.name,
                    fixed(abs(peak), 1),
                    _printed(axis, subject, "peak_difference"),
                    fixed(abs(error), 1),
                    _printed(axis, subject, "error_difference"),
                ]
            )
    return Grid(
        f"Table II · {flight.recording.name}: difference from the experiment, in degrees",
        ["axis", "model", "peak: here", "paper†", "error: here", "paper†"],
        rows,
        notes=[
            f"† Cannot be reproduced: {NO_EXPERIMENT}. This is another flight, so the columns may "
            "differ.",
            *CAVEATS[:2],
        ],
        text_columns=2,
    )


def _subject(model: ModelComparison, models: Sequence[ModelComparison]) -> Subject | None:
    """Return the paper's model that ``model`` corresponds to: hover, identification, or None."""
    if model.kind == "hover":
        return "hover"
    identified = [m for m in models if not m.kind.startswith(("hover", "paper"))]
    return "identification" if identified and model is identified[0] else None


def _printed(axis: str, subject: Subject | None, quantity: Quantity) -> str:
    number = None if subject is None else published(axis, subject, quantity)
    return NONE if number is None else f"{number.value_deg:g}"


def published_table(rows: Iterable[Reproduced]) -> Grid:
    """Return a table of the paper's numbers, each with the number simulated here, if possible."""
    cells = []
    reasons: dict[str, str] = {}
    for r in rows:
        p = r.published
        mark = reasons.setdefault(p.why, "abcdefgh"[len(reasons)])
        cells.append(
            [
                p.axis,
                p.subject,
                QUANTITIES[p.quantity],
                f"{p.value_deg:g}",
                fixed(r.ours_deg),
                f"{'yes' if p.reproducible else 'no'} ({mark})",
                p.where,
            ]
        )
    return Grid(
        "The paper's numbers and their reproduction",
        ["axis", "of", "quantity", "paper °", "ours °", "reproducible", "where"],
        cells,
        notes=[*(f"({mark}) {why}." for why, mark in reasons.items()), DELTA, *CAVEATS],
        text_columns=3,
        prose_columns=2,
    )


def flight_grids(flight: FlightComparison) -> list[Grid]:
    """Return one recording's tables: step metrics and Table II (if replayed), and predictions."""
    replayed = metrics_table(flight) if flight.why is None else None
    grids = (replayed, table_ii(flight), prediction_table(flight))
    return [g for g in grids if g is not None]


def comparison_grids(comparison: Comparison, reproduced: Sequence[Reproduced] = ()) -> list[Grid]:
    """Return the tables of all recordings; if ``reproduced`` is given, also the paper's numbers."""
    grids = [g for flight in comparison.flights for g in flight_grids(flight)]
    return [*grids, published_table(reproduced)] if reproduced else grids


def comparison_renderables(
    comparison: Comparison, reproduced: Sequence[Reproduced] = ()
) -> list[RenderableType]:
    """Return the tables of `comparison_grids` for a terminal, each followed by an empty line."""
    from rich.padding import Padding

    below = (0, 0, 1, 0)
    return [Padding(to_rich(g), below) for g in comparison_grids(comparison, reproduced)]


def _model_notes(flight: FlightComparison) -> list[str]:
    return [f"{m.name}: {reason}" for m in flight.models for reason in m.cannot]
