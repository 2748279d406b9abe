"""Make the tables that `heli3dof compare` prints.

- Step metrics, such as overshoot, of the measured and the simulated angles
- RMSE of multi-step predictions and of the closed-loop simulation
- A table like Table II of the paper whose models heli3dof reproduces (`heli3dof.paper`)
- All numbers of this paper, each with the number that heli3dof simulates

A table is a `Grid`, which `heli3dof.report.text.table` renders.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from heli3dof.axes import AXES, ROLL
from heli3dof.comparison.metrics import AxisMetrics, Kind, StepMetrics
from heli3dof.comparison.prediction import CONSTANT_ANGLES
from heli3dof.comparison.result import (
    Comparison,
    FlightComparison,
    ModelComparison,
    PredictionError,
)
from heli3dof.comparison.verdict import HORIZON_S, prediction_errors, replay_errors, verdict
from heli3dof.paper.published import CAVEATS, NO_EXPERIMENT, Quantity, Subject, published
from heli3dof.paper.reproduction import Reproduced
from heli3dof.report.text.number_format import NONE, fixed, short
from heli3dof.report.text.table import Grid

EXPERIMENT = "experiment"
DIFFERENCE = "  Δ"
MOST_ROWS = 12
"""Largest number of rows of `fit_table`, so that it fits a screen"""
NO_ERRORS = np.full(len(AXES), np.nan)
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
    """Return a table of step metrics: of the experiment, each model, and their differences.

    The last column is the RMSE of each model's closed-loop replay in degrees.
    """
    rows = []
    for i, axis in enumerate(AXES):
        measured = flight.experiment[axis].reported
        rows.append([axis, EXPERIMENT, *_metric_cells(measured.values(), measured.kind), NONE])
        for m in flight.models:
            if m.metrics is None:
                continue
            rmse = np.nan if m.replay_rmse_deg is None else m.replay_rmse_deg[i]
            ours = m.metrics[axis].reported.values()
            away = flight.difference(m, axis)
            rows.append([axis, m.name, *_metric_cells(ours, measured.kind), fixed(rmse)])
            if any(np.isfinite(v) for v in away.values()):
                rows.append([axis, DIFFERENCE, *_metric_cells(away, measured.kind, sign=True), ""])
    about = "; ".join(f"{axis} {step_name(flight.experiment[axis].reported)}" for axis in AXES)
    return Grid(
        f"Closed-loop replay · {flight.recording.name}",
        ["axis", "", *METRIC_HEADS, "RMSE °"],
        rows,
        notes=[
            f"Steps: {about}.",
            "Δ: model minus experiment. The paper prints the peak as overshoot. Here overshoot is "
            "peak minus set value (E10), also in % of the step; a held axis has none.",
            *_model_notes(flight),
        ],
        text_columns=2,
    )


METRIC_HEADS = ("peak °", "overshoot °", "% of step", "error °", "rise s", "settling s")


def metrics_of(metrics: Mapping[str, AxisMetrics], title: str) -> Grid:
    """Return a table of step metrics, with a row per reference segment of each axis."""
    rows = []
    for axis, of_axis in metrics.items():
        for step in of_axis.steps:
            if step.kind != "none":
                rows.append([axis, step_name(step), *_metric_cells(step.values(), step.kind)])
    notes = ["error: angle minus set value, mean over the last tenth of the step."] * bool(rows)
    if any(row[-1] == NONE for row in rows):
        notes.append("– under settling: no step, or the angle did not stay within ±2 % of it.")
    return Grid(title, ["axis", "step", *METRIC_HEADS], rows, notes=notes, text_columns=2)


def _metric_cells(values: Mapping[str, float], kind: Kind, *, sign: bool = False) -> list[str]:
    """Return the cells of step metrics; a held axis has a peak, but no overshoot."""
    return [
        NONE
        if kind == "hold" and name == "overshoot_deg"
        else fixed(value, 1 if name == "overshoot_percent" else 2, sign=sign)
        for name, value in values.items()
    ]


def prediction_table(flight: FlightComparison) -> Grid | None:
    """Return a table of prediction RMSE (°) by axis, model, horizon; None without predictions."""
    if flight.constant_angles is None:
        return None
    horizons = list(flight.constant_angles.ahead_deg)
    window = flight.constant_angles.window_s
    rows = []
    for axis in flight.flown.axes:
        for name, error in flight.predictions.items():
            rows.append([axis, name, *_prediction_cells(error, axis, horizons)])
    heads = [f"{h:g} s ahead" for h in horizons]
    return Grid(
        f"Multi-step prediction, RMSE in degrees · {flight.recording.name}",
        ["axis", "", *heads, f"over {window:g} s"],
        rows,
        notes=[
            "Each prediction starts from a state estimated up to then and uses the measured "
            "voltages. All models are evaluated on the same samples, without take-off, table and "
            "stops.",
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
    """Return a table like Table II of the paper, with the numbers of the paper and of this flight.

    The numbers are |model − experiment| of the peak and of the steady error. The paper's word for
    the peak is overshoot (erratum E10). Returns None if the closed loop was not simulated with the
    recording's references.
    """
    if flight.why is not None:
        return None
    rows = []
    for axis in AXES:
        for m in flight.models:
            subject = _column_of_table_ii(m, flight.models)
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


def _column_of_table_ii(
    model: ModelComparison, models: Sequence[ModelComparison]
) -> Subject | None:
    """Return the column of the paper's Table II with which ``model`` is compared, or None.

    Table II has numbers of two models: the "hover" model and one "identification". The second
    column is compared with the first identified model in ``models``.
    """
    if model.kind == "hover":
        return "hover"
    identified = [m for m in models if not m.kind.startswith(("hover", "paper"))]
    return "identification" if identified and model is identified[0] else None


def _printed(axis: str, subject: Subject | None, quantity: Quantity) -> str:
    number = None if subject is None else published(axis, subject, quantity)
    return NONE if number is None else f"{number.value_deg:g}"


def published_table(rows: Iterable[Reproduced]) -> Grid:
    """Return a table of the paper's numbers, each with heli3dof's simulated number, if possible."""
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


def fit_table(comparison: Comparison) -> Grid:
    """Return one table with the RMSE of all models on each axis, by recording.

    The first columns have the RMSE of multi-step predictions. The others have the RMSE of the
    closed-loop simulation with the recording's references (replay). The last row of each recording
    has the errors of predicting that the angles stay constant. If the table would have more than
    `MOST_ROWS` rows, it has one row per model instead, with the RMS over all recordings.
    """
    horizon = min(comparison.horizons_s, key=lambda h: abs(h - HORIZON_S), default=HORIZON_S)
    flights = [replace(comparison, flights=(f,)) for f in comparison.flights]
    if sum(len(f.models) + 1 for f in comparison.flights) > MOST_ROWS:
        flights = [comparison]
    replayed = any(f.why is None for f in comparison.flights)
    rows = []
    for part in flights:
        ahead = prediction_errors(part, horizon)
        again = replay_errors(part)
        name = part.flights[0].recording.name if len(part.flights) == 1 else "all"
        models = dict.fromkeys(m.name for f in part.flights for m in f.models)
        for model in (*models, CONSTANT_ANGLES):
            errors = [*ahead.get(model, NO_ERRORS)]
            errors += [*again.get(model, NO_ERRORS)] if replayed else []
            rows.append([name, model, *(fixed(float(e)) for e in errors)])
    columns = [f"{horizon:g}\u00a0s", *(["replay"] if replayed else [])]
    heads = ["model", *(f"{axis} {what}" for what in columns for axis in AXES)]
    title = f"RMSE in degrees: predictions {horizon:g} s ahead"
    title += ", closed-loop replay" if replayed else ""
    if len(flights) == 1:
        name = "RMS over all recordings" if rows[0][0] == "all" else rows[0][0]
        return Grid(f"{title} · {name}", heads, [row[1:] for row in rows])
    return Grid(title, ["recording", *heads], rows, text_columns=2)


def flight_grids(flight: FlightComparison, *, paper: bool = False) -> list[Grid]:
    """Return the tables of one recording: step metrics and prediction errors.

    The table of step metrics exists only if `compare` has simulated the closed loop. If it has, and
    ``paper`` is True, the result also contains a table like Table II of the paper (`table_ii`). The
    table of prediction errors exists only if `compare` has made predictions.
    """
    replayed = metrics_table(flight) if flight.why is None else None
    grids = (replayed, table_ii(flight) if paper else None, prediction_table(flight))
    return [g for g in grids if g is not None]


def comparison_grids(comparison: Comparison, *, paper: bool = False) -> list[Grid]:
    """Return the table of all models, then each recording's tables (`flight_grids`)."""
    grids = [g for f in comparison.flights for g in flight_grids(f, paper=paper)]
    return [fit_table(comparison), *grids]


def comparison_summary(comparison: Comparison, *, paper: bool = False) -> list[str | Grid]:
    """Return what `heli3dof compare` prints without --verbose: the verdict and the fit table.

    ``paper`` adds a table like Table II for each recording with a step in roll, the paper's
    experiment.
    """
    lines: list[str | Grid] = [*verdict(comparison), fit_table(comparison)]
    for f in comparison.flights if paper else ():
        steps = f.experiment[AXES[ROLL]].reported.kind in ("step", "start")
        if steps and (grid := table_ii(f)) is not None:
            lines.append(replace(grid, notes=grid.notes[:1]))
    return lines


def _model_notes(flight: FlightComparison) -> list[str]:
    return [f"{m.name}: {reason}" for m in flight.models for reason in m.cannot]
