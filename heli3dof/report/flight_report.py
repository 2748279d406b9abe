"""Write the HTML report of flights: summary, warnings, flights, models, comparison, provenance.

``heli3dof report``, ``diagnose --report`` and ``demo`` use this report.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from heli3dof.axes import AXES, ROLL
from heli3dof.comparison.metrics import flight_metrics
from heli3dof.comparison.prediction import ConstantAngles
from heli3dof.comparison.result import Comparison, FlightComparison, ModelComparison
from heli3dof.comparison.verdict import verdict
from heli3dof.model.base import Model
from heli3dof.paper.reproduction import Reproduced
from heli3dof.recording.recording import Recording
from heli3dof.report.comparison_tables import (
    fit_table,
    flight_grids,
    metrics_of,
    published_table,
)
from heli3dof.report.figures import NUMBER, axis_figures, flight_figure
from heli3dof.report.html import (
    Section,
    facts,
    figure,
    key,
    listing,
    page,
    paragraph,
    subheading,
    table,
    warning,
)
from heli3dof.report.model_section import model_blocks
from heli3dof.report.text_table import fixed

LONG = 200
"""Number of characters above which a metadata value gets its own listing (a convention)"""


def flight_report(
    recordings: Sequence[Recording],
    *,
    models: Sequence[Model] = (),
    comparison: Comparison | None = None,
    reproduced: Sequence[Reproduced] = (),
    first: Iterable[Section] = (),
    extra: Iterable[Section] = (),
    lede: Sequence[str] = (),
    title: str = "",
) -> str:
    """Return the report as an HTML document.

    The sentences ``lede`` open the summary. The sections ``first`` come before the flights, and
    ``extra`` (of an identification, for example) after the comparison. ``reproduced`` is the result
    of `heli3dof.paper.reproduction.reproduce`.
    """
    names = ", ".join(r.name for r in recordings)
    warnings = _warnings(recordings, comparison)
    short = [] if comparison is None else [in_a_sentence(f) for f in comparison.flights]
    sections = [
        Section("Summary", [key(s) for s in (*lede, *short)]),
        Section("Warnings", [warning(w) for w in warnings]),
        *first,
        Section("The flight" if len(recordings) == 1 else "The flights", _flights(recordings)),
        Section("Models", model_blocks(models, recordings[0].profile if recordings else None)),
        Section(
            "Comparison",
            [] if comparison is None else _comparison(comparison, paper=bool(reproduced)),
        ),
        *extra,
        Section("The paper's numbers", [table(published_table(reproduced))] if reproduced else []),
        Section("Provenance", _provenance(recordings)),
    ]
    seconds = sum(r.duration for r in recordings)
    return page(
        title or f"Flight report: {names}",
        f"{len(recordings)} recording{'s' if len(recordings) != 1 else ''}, {seconds:.1f} s"
        + (f", {len(models)} model{'s' if len(models) != 1 else ''}" if models else ""),
        sections,
        footer="Angles in degrees: roll is the arm's elevation (+ body up), pitch the body's tilt "
        "(+ front motor up), yaw the travel (+ counter-clockwise).",
    )


def _flights(recordings: Sequence[Recording]) -> list[str]:
    blocks = []
    for r in recordings:
        if len(recordings) > 1:
            blocks.append(subheading(r.name))
        blocks.append(facts(_summary(r)))
        blocks.append(figure(flight_figure(r), f"Angles and voltages of {r.name} over time"))
        if any(r.has_reference(axis) for axis in AXES):
            blocks.append(table(metrics_of(flight_metrics(r), "Step metrics")))
    return blocks


def _summary(r: Recording) -> dict[str, Any]:
    """Return name → text of a recording's properties, such as duration, outcome, controller."""
    gaps = np.diff(r.t) > 1.5 * r.dt
    return {
        "plan": _plan_name(r),
        "device": r.meta.get("device"),
        "ended": ": ".join(_ending(r)) or None,
        "duration": fixed(r.duration, 1, " s"),
        "samples": f"{len(r)} at {1 / r.dt:.6g} Hz"
        + (f", {gaps.sum()} gaps" if gaps.any() else ""),
        "rig": r.profile.name,
        "controller": "known"
        if r.profile.controller_is_known
        else "unknown: no closed-loop replay",
        "voltage": f"{fixed(float(np.nanmin(r.voltage)), 1)} to "
        f"{fixed(float(np.nanmax(r.voltage)), 1)} V (limit ±{r.profile.motor.v_max:g} V)",
    }


def _ending(r: Recording) -> list[str]:
    """Return [outcome] or [outcome, reason] of a flight; an empty list for an imported log."""
    outcome, details = r.meta.get("outcome"), r.meta.get("outcome_details", {})
    if outcome is None:
        return []
    reason = details.get("detail") or details.get("reason")
    return [str(outcome), str(reason)] if reason else [str(outcome)]


def _plan_name(r: Recording) -> str | None:
    plan = r.meta.get("plan")
    if isinstance(plan, Mapping):
        return str(plan.get("name", "")) or None
    return None if plan is None else str(plan)


def _comparison(comparison: Comparison, *, paper: bool) -> list[str]:
    blocks = [key(s) for s in verdict(comparison)]
    blocks.append(table(fit_table(comparison)))
    for f in comparison.flights:
        if len(comparison.flights) > 1:
            blocks.append(subheading(f.recording.name))
        if f.why is not None:
            blocks.append(
                paragraph(f"Not replayed: {f.why}. The curves are multi-step predictions.")
            )
        for axis, drawn in axis_figures(f).items():
            alt = f"Figure {NUMBER[axis]}: {axis} of {f.recording.name}, experiment and models"
            blocks.append(figure(drawn, alt))
        blocks += [table(g) for g in flight_grids(f, paper=paper)]
    return blocks


def in_a_sentence(flight: FlightComparison) -> str:
    """Return sentences that compare one recording with each model: peak of roll, RMSE."""
    if not flight.models:
        return "No model was compared."
    if flight.why is None:
        peak = flight.experiment["roll"].reported.peak_deg
        sentences = [f"{flight.recording.name}: roll peaks at {fixed(peak, 1, '°')}."]
        sentences += [_replay_sentence(flight, m) for m in flight.models]
        return " ".join([*sentences, _prediction_sentence(flight)])
    sentences = []
    for m in flight.models:
        if m.prediction is None:
            sentences.append(f"{m.name}: none.")
            continue
        errors = [
            f"{fixed(m.prediction.over_window_deg[AXES.index(a)], 1, '°')} in {a}"
            for a in flight.flown.axes
        ]
        sentences.append(f"{m.name}: {', '.join(errors)}.")
    window = flight.constant_angles.window_s if flight.constant_angles else 0.0
    title = f"{flight.recording.name}, RMSE of predictions over {window:g} s"
    return f"{title}: " + " ".join(sentences)


def _replay_sentence(flight: FlightComparison, m: ModelComparison) -> str:
    if m.diverged_at_s is not None:
        return f"{m.name} diverges at {m.diverged_at_s:.1f} s."
    if m.metrics is None or m.replay_rmse_deg is None:
        return f"{m.name} was not replayed."
    difference = flight.difference(m, "roll")["peak_deg"]
    rmse = ", ".join(fixed(v, 2, "°") for v in m.replay_rmse_deg)
    peak = ""
    if np.isfinite(difference):
        apart = f"{fixed(abs(difference), 1, '°')} {'higher' if difference > 0 else 'lower'}"
        peak = f" peaks {apart if abs(difference) >= 0.05 else 'at the same height'};"
    return f"{m.name}{peak} its RMSE over the flight is {rmse} in roll, pitch, yaw."


def _prediction_sentence(flight: FlightComparison) -> str:
    """Return a sentence with each model's RMSE of roll predictions; empty without predictions."""
    if flight.constant_angles is None:
        return ""
    named = [(m.name, m.prediction) for m in flight.models]
    errors = [
        f"{fixed(p.over_window_deg[ROLL], 1, '°')} ({name})"
        for name, p in (*named, (ConstantAngles.name, flight.constant_angles))
        if p is not None
    ]
    window = flight.constant_angles.window_s
    return f"RMSE of roll predictions over {window:g} s: {', '.join(errors)}."


def _warnings(recordings: Sequence[Recording], comparison: Comparison | None) -> list[str]:
    warnings = []
    for r in recordings:
        warnings += [f"{r.name}: {w}" for w in r.meta.get("warnings", ())]
        ending = _ending(r)
        if ending and ending[0] != "completed":
            warnings.append(f"{r.name}: the flight did not end as planned; {': '.join(ending)}.")
    return warnings + list(comparison.warnings if comparison else ())


def _provenance(recordings: Sequence[Recording]) -> list[str]:
    blocks = []
    for r in recordings:
        if len(recordings) > 1:
            blocks.append(subheading(r.name))
        short, long = _flat(r.meta)
        blocks.append(facts({"data (SHA-256)": r.digest, **short}))
        for name, value in long.items():
            blocks += [paragraph(f"{name}:"), listing(value)]
        blocks += [paragraph("profile:"), listing(r.profile.to_dict())]
    return blocks


def _flat(meta: Mapping[str, Any], prefix: str = "") -> tuple[dict[str, Any], dict[str, Any]]:
    """Flatten nested metadata to two dicts by dotted name: values that fit a line, long values."""
    short: dict[str, Any] = {}
    long: dict[str, Any] = {}
    for name, value in meta.items():
        if name == "profile" or (name == "warnings" and not prefix):
            continue
        if isinstance(value, Mapping) and len(str(value)) <= 5 * LONG and name != "plan":
            inner_short, inner_long = _flat(value, f"{prefix}{name}.")
            short.update(inner_short)
            long.update(inner_long)
        elif isinstance(value, (Mapping, list, tuple)) and len(str(value)) > LONG:
            long[f"{prefix}{name}"] = value
        else:
            plain = value is None or isinstance(value, (str, int, float))
            text = value if plain else json.dumps(value, ensure_ascii=False, default=str)
            short[f"{prefix}{name}"] = text
    return short, long
