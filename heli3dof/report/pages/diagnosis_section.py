"""Write the section of the HTML report on a diagnosis: verdict, tables, and a figure per cause.

The JSON document of ``diagnose --json`` gives the sentences
(`heli3dof.report.text.diagnosis_sentences`) and tables (`heli3dof.report.text.diagnosis_tables`).
The figures and further tables need data that are not in this document;
`heli3dof.report.figures.diagnosis_data` computes these data.
"""

from __future__ import annotations

from collections.abc import Sequence

from heli3dof.axes import AXES
from heli3dof.diagnosis import name_of
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.simulation_error import SimulationError
from heli3dof.report.figures.diagnosis import evidence_alt, evidence_figure
from heli3dof.report.figures.diagnosis_data import FigureData
from heli3dof.report.figures.replayed_flight import Replayed
from heli3dof.report.figures.worst_stretch import stretch_figure, worst_stretch
from heli3dof.report.pages.html import Section, figure, key, paragraph, subheading, table, warning
from heli3dof.report.text import diagnosis_sentences as words
from heli3dof.report.text.diagnosis_sentences import Document
from heli3dof.report.text.diagnosis_tables import calibration, findings, gains
from heli3dof.report.text.number_format import NONE, fixed
from heli3dof.report.text.table import Grid


def diagnosis_section(document: Document, p: FigureData = FigureData()) -> Section:
    """Return the HTML section on a diagnosis: ``document`` is its JSON, ``p`` its figures' data."""
    bad = document["verdict"] == "bad_data"
    blocks = [key(words.verdict(document))]
    blocks += [warning(s) if bad else paragraph(s) for s in words.faults(document)]
    blocks += map(paragraph, words.limits(document))
    blocks += _stretch(p)
    if (grid := findings(document)).rows:
        blocks.append(table(grid))
    refit = words.gain(document) if words.states_refit(document) else ()
    details = [paragraph(s) for s in (*refit, *words.calibration_change(document))]
    if steps := [paragraph(s) for s in words.next_steps(document)]:
        details += [subheading("What to do next"), *steps]
    if p.simulation_error is not None:
        details.append(table(error_table(p.simulation_error)))
    details += [*_causes(document, p), *_gain(document, p), *_unmodelled(document, p)]
    if document["calibration"]:
        details.append(table(calibration(document)))
        details += map(paragraph, words.calibration_doubts(document))
    return Section("Diagnosis", blocks, details)


def _stretch(p: FigureData) -> list[str]:
    if p.gain is None or p.before is None or p.after is None:
        return []
    if (w := worst_stretch(p.before, p.after)) is None:
        return []
    name = p.names[w.source] if w.source < len(p.names) else ""
    drawn = stretch_figure(p.before, p.after, w, name)
    return [figure(drawn, f"The worst stretch of {w.axis}, before and after")]


def _causes(document: Document, p: FigureData) -> list[str]:
    if not document["findings"]:
        return []
    blocks = [subheading("Causes")]
    evidence = {e.name: e for e in p.evidence}
    written: set[str] = set()
    for finding, sentence in zip(document["findings"], words.causes(document), strict=True):
        if sentence in written:  # two recordings may share a fault
            continue
        written.add(sentence)
        blocks.append(paragraph(sentence))
        if e := evidence.get(name_of(finding)):
            blocks.append(figure(evidence_figure(e), evidence_alt(e)))
    return blocks + [paragraph(s) for s in document.get("about", {}).get("explains", ())]


def _gain(document: Document, p: FigureData) -> list[str]:
    if p.gain is None:
        return []
    blocks = [subheading("Gain of the extended model")]
    if (grid := gains(document)).rows:
        blocks.append(table(grid))
    if p.replayed:
        blocks.append(table(replayed_table(p.replayed)))
    return blocks


def _unmodelled(document: Document, p: FigureData) -> list[str]:
    sentences = (words.equation_changes, words.kept_terms, words.not_adopted)
    blocks = [paragraph(s) for each in sentences for s in each(document)]
    if unmodelled := [paragraph(s) for s in words.unmodelled_effects(document)]:
        blocks += [subheading("Unmodelled effects"), *unmodelled]
    if p.residual_torques:
        blocks.append(table(residual_torque_table(p.residual_torques)))
        blocks += [figure(evidence_figure(e), evidence_alt(e)) for e in p.residual_evidence]
    blocks += map(paragraph, words.slow_noise(document))
    if deviations := [paragraph(s) for s in words.model_deviations(document)]:
        blocks += [subheading("Not explained by the extended model"), *deviations]
    return blocks


def error_table(w: SimulationError) -> Grid:
    """Return a table of the simulation error ``w``: RMSE, noise floor (°) by horizon and axis."""
    rows = [
        [f"{h:g}", *(fixed(float(x[k, i]), 3) for i in range(3) for x in (w.rmse_deg, w.floor_deg))]
        for k, h in enumerate(w.horizons_s)
    ]
    floor = f"RMSE that noise alone causes, by {w.floor_by}" if w.floor_by else "unknown"
    notes = [f"Predictions start from states re-estimated every 50 ms. Floor: {floor}."]
    notes += [
        f"Worst stretch of {s.axis}: {s.start_s:.1f} to {s.stop_s:.1f} s of {s.recording}, "
        f"RMSE {fixed(s.rmse_deg, 2, '°')} over 1 s."
        for s in w.worst
    ]
    heads = ["horizon s", *(f"{a} {x}" for a in AXES for x in ("RMSE", "floor"))]
    return Grid("Simulation error, degrees", heads, rows, notes, text_columns=0)


def residual_torque_table(residual_torques: Sequence[ResidualTorque]) -> Grid:
    """Return a table of the residual torques that no known effect explains, one row each."""
    rows = [
        [
            r.axis,
            words.variable(r.depends_on),
            f"{100 * r.share:.0f}",
            f"{r.confidence:.4f}",
            r.resembles or NONE,
            words.variable(", ".join(r.also)) or NONE,
        ]
        for r in residual_torques
    ]
    notes = ["Share of the variance of the axis' residual torque."]
    heads = ["torque on", "depends on", "share %", "confidence", "similar to", "or on"]
    return Grid("Unmodelled effects", heads, rows, notes, 2, prose_columns=2)


def replayed_table(replayed: Sequence[Replayed]) -> Grid:
    """Return a table of overshoot and steady error (°) in flights and in two models' replays."""
    rows = [
        [r.recording, r.axis, *(fixed(v, 2) for v in (*r.overshoot_deg, *r.steady_error_deg))]
        for r in replayed
    ]
    three = ("measured", "before", "after")
    heads = ["recording", "axis", *(f"{w} {x}" for w in ("overshoot", "error") for x in three)]
    notes = ["Closed-loop replay of the recording's references; degrees."]
    return Grid("Table II before and after", heads, rows, notes, text_columns=2)
