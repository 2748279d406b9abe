"""Write the HTML report: answers, warnings, then comparison, identification, diagnosis, flights.

``heli3dof report``, ``identify --report``, ``diagnose --report``, ``run --auto`` and ``demo`` use
this report.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.comparison.compare import Models
from heli3dof.comparison.metrics import flight_metrics
from heli3dof.comparison.result import Comparison
from heli3dof.comparison.verdict import verdict
from heli3dof.diagnosis.result import Diagnosis
from heli3dof.identification.result import Identification
from heli3dof.paper.reproduction import Reproduced
from heli3dof.recording.logs.log_validation import timing
from heli3dof.recording.recording import Recording
from heli3dof.recording.safety_trip import outcome_details
from heli3dof.report.figures.comparison import NUMBER, axis_figures
from heli3dof.report.figures.diagnosis_data import FigureData, figure_data
from heli3dof.report.figures.flight import flight_figure
from heli3dof.report.pages.answers import (
    comparison_answers,
    diagnosis_answers,
    identification_answer,
    worst_axis,
)
from heli3dof.report.pages.diagnosis_section import diagnosis_section
from heli3dof.report.pages.html import (
    Answer,
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
from heli3dof.report.pages.identification_section import identification_section
from heli3dof.report.pages.model_section import model_blocks
from heli3dof.report.text.comparison_sentences import comparison_text
from heli3dof.report.text.comparison_tables import (
    fit_table,
    flight_grids,
    metrics_of,
    published_table,
)
from heli3dof.report.text.diagnosis_sentences import Document
from heli3dof.report.text.number_format import fixed

SHOWN_WARNINGS = 3
"""Largest number of warnings that are visible without a click (a convention)"""
LONG = 200
"""Number of characters above which a metadata value gets its own listing (a convention)"""


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """A diagnosis for the report: its ``diagnose --json`` document, and its figures' data."""

    document: Document
    data: FigureData


def flight_report(
    recordings: Sequence[Recording],
    *,
    models: Models = (),
    comparison: Comparison | None = None,
    identified: Sequence[Identification] = (),
    diagnosed: Diagnosis | Diagnosed | None = None,
    reproduced: Sequence[Reproduced] = (),
    title: str = "",
) -> str:
    """Return the report of ``recordings`` as an HTML document.

    ``models``: as in `heli3dof.comparison.compare.compare`. ``reproduced`` is the result of
    `heli3dof.paper.reproduction.reproduce`. ``diagnosed`` is the result of `heli3dof.diagnose`. If
    it names causes, a table compares overshoot and steady error in flight with two closed-loop
    simulations: one without the causes, one with them. The table contains those of ``recordings``
    that the diagnosis held out. If there are none, it contains those to which the diagnosis fitted
    its models.
    """
    models = models(recordings[0]) if callable(models) else models
    if isinstance(diagnosed, Diagnosis):
        fitted, held = (
            [r for r in recordings if r.name in names]
            for names in (diagnosed.recordings, diagnosed.holdout)
        )
        diagnosed = Diagnosed(diagnosed.to_dict(), figure_data(diagnosed, fitted, held))
    names = ", ".join(r.name for r in recordings)
    warnings = [warning(w) for w in _warnings(recordings, comparison)]
    diagnosis = [] if diagnosed is None else [diagnosis_section(diagnosed.document, diagnosed.data)]
    sections = [
        Section("Warnings", warnings[:SHOWN_WARNINGS], warnings[SHOWN_WARNINGS:]),
        *([] if comparison is None else [_comparison(comparison, paper=bool(reproduced))]),
        *(identification_section(i) for i in identified),
        *diagnosis,
        Section("The flight" if len(recordings) == 1 else "The flights", (), _flights(recordings)),
        Section("Models", (), model_blocks(models, recordings[0].profile if recordings else None)),
        Section("The paper's numbers", (), [table(published_table(reproduced))])
        if reproduced
        else Section(""),
        Section("Provenance", (), _provenance(recordings)),
    ]
    seconds = sum(r.duration for r in recordings)
    return page(
        title or f"Flight report: {names}",
        f"{len(recordings)} recording{'s' if len(recordings) != 1 else ''}, {seconds:.1f} s"
        + (f", {len(models)} model{'s' if len(models) != 1 else ''}" if models else ""),
        sections,
        answers=_answers(recordings, comparison, identified, diagnosed),
        footer="Angles in degrees: roll is the arm's elevation (+ body up), pitch the body's tilt "
        "(+ front motor up), yaw the travel (+ counter-clockwise).",
    )


def diagnosis_page(
    found: Diagnosis,
    document: dict[str, Any],
    recordings: Sequence[Recording],
    holdout: Sequence[Recording] = (),
    *,
    title: str = "",
) -> str:
    """Return the HTML page of the diagnosis ``found``.

    ``document``: its ``diagnose --json`` document; ``recordings``, ``holdout``: the recordings that
    were fitted and held out. The default title names ``recordings``.
    """
    diagnosed = Diagnosed(document, figure_data(found, recordings, holdout))
    names = ", ".join(r.name for r in recordings)
    return flight_report(
        [*recordings, *holdout], diagnosed=diagnosed, title=title or f"Diagnosis: {names}"
    )


def _answers(
    recordings: Sequence[Recording],
    comparison: Comparison | None,
    identified: Sequence[Identification],
    diagnosed: Diagnosed | None,
) -> list[Answer]:
    """Return the questions and answers at the top of the report.

    They state the main results of the diagnosis. If there is no diagnosis, they state those of the
    comparison. If no flight was compared either, they state those of each identification.
    """
    if diagnosed is not None:
        dt = recordings[0].dt
        return diagnosis_answers(diagnosed.document, diagnosed.data, dt)
    if comparison is not None and comparison.flights:
        return comparison_answers(comparison)
    return [identification_answer(i) for i in identified]


def _flights(recordings: Sequence[Recording]) -> list[str]:
    blocks = []
    for r in recordings:
        if len(recordings) > 1:
            blocks.append(subheading(r.name))
        blocks.append(facts(_summary(r)))
        alt = f"Angles and voltages of {r.name} over time"
        blocks.append(figure(flight_figure(r), alt, flight=r.digest))
        if any(r.has_reference(axis) for axis in AXES):
            blocks.append(table(metrics_of(flight_metrics(r), "Step metrics")))
    return blocks


def _summary(r: Recording) -> dict[str, Any]:
    """Return a dict of a recording's properties, such as duration and outcome: name → text."""
    gaps = timing(r.t).gaps
    plan = r.meta.get("plan")
    if isinstance(plan, Mapping):
        plan = plan.get("name") or None
    return {
        "plan": plan,
        "device": r.meta.get("device"),
        "ended": ": ".join(_ending(r)) or None,
        "duration": fixed(r.duration, 1, " s"),
        "samples": f"{len(r)} at {1 / r.dt:.6g} Hz" + (f", {gaps} gaps" if gaps else ""),
        "rig": r.profile.name,
        "controller": "known"
        if r.profile.controller_is_known
        else "unknown: no closed-loop replay",
        "voltage": f"{fixed(float(np.nanmin(r.voltage)), 1)} to "
        f"{fixed(float(np.nanmax(r.voltage)), 1)} V (limit ±{r.profile.motor.v_max:g} V)",
    }


def _ending(r: Recording) -> list[str]:
    """Return [outcome] or [outcome, reason] of a flight; an empty list for an imported log."""
    outcome, details = r.meta.get("outcome"), outcome_details(r)
    if outcome is None:
        return []
    reason = details.get("detail") or details.get("reason")
    return [str(outcome), str(reason)] if reason else [str(outcome)]


def _comparison(comparison: Comparison, *, paper: bool) -> Section:
    """Return the section of a comparison; ``paper`` adds tables like the paper's Table II."""
    blocks = [key(s) for s in verdict(comparison)]
    details = []
    for n, f in enumerate(comparison.flights):
        if len(comparison.flights) > 1:
            details.append(subheading(f.recording.name))
        if f.why is not None:
            reason = f"Not replayed: {f.why}. The curves are multi-step predictions."
            (details if n else blocks).append(paragraph(reason))
        first = worst_axis(f, f.models[0]) if n == 0 and f.models else ""
        for axis, drawn in axis_figures(f).items():
            alt = f"Figure {NUMBER[axis]}: {axis} of {f.recording.name}, experiment and models"
            (blocks if axis == first else details).append(
                figure(drawn, alt, flight=f.recording.digest)
            )
        details.append(paragraph(comparison_text(f)))
        details += [table(g) for g in flight_grids(f, paper=paper)]
    return Section("Comparison", [*blocks, table(fit_table(comparison))], details)


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
    """Return nested metadata as two flat dicts, of short and of long values: dotted name → value.

    ``profile`` and the outermost ``warnings`` are left out.
    """
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
