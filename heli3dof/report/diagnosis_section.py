"""A diagnosis as a section of the HTML report: what is wrong, the causes, each with its picture.

The words and the causes' table come from the contract's document
(`heli3dof.report.diagnosis_text`, `heli3dof.report.diagnosis_tables`); the figures, and what the
document has no room for, from `Pictured`.
"""

from __future__ import annotations

from collections.abc import Sequence

from heli3dof.axes import AXES
from heli3dof.diagnosis.gain import Gain
from heli3dof.diagnosis.gain_replay import Replayed
from heli3dof.diagnosis.how_wrong import HowWrong
from heli3dof.diagnosis.leftover import Leftover
from heli3dof.diagnosis.torque_evidence import Evidence
from heli3dof.report import diagnosis_text as words
from heli3dof.report.diagnosis_figure_data import Pictured
from heli3dof.report.diagnosis_figures import evidence_figure, stretch_figure
from heli3dof.report.diagnosis_tables import calibration, findings
from heli3dof.report.diagnosis_text import Document
from heli3dof.report.html import Section, figure, key, paragraph, subheading, table, warning
from heli3dof.report.text_table import NONE, Grid, fixed


def diagnosis_section(
    document: Document, p: Pictured = Pictured(), title: str = "Diagnosis"
) -> Section:
    """Verdict and faults, how wrong, the causes, the gain, what is left, what to do next."""
    bad = document["verdict"] == "bad_data"
    blocks = [key(words.verdict(document))]
    blocks += [warning(s) if bad else paragraph(s) for s in words.faults(document)]
    blocks += map(paragraph, words.unmeasured(document))
    blocks += [*_next(document), *_wrong(p), *_causes(document, p), *_gain(p), *_left(document, p)]
    if document["calibration"]:
        blocks.append(table(calibration(document)))
        blocks += map(paragraph, words.perhaps_off(document))
    return Section(title, blocks)


def _next(document: Document) -> list[str]:
    steps = [paragraph(s) for s in words.next_steps(document)]
    return [subheading("What to do next"), *steps] if steps else []


def _wrong(p: Pictured) -> list[str]:
    return [] if p.wrong is None else [table(how_wrong_table(p.wrong))]


def _causes(document: Document, p: Pictured) -> list[str]:
    told = findings(document)
    if not told.rows:
        return []
    blocks = [subheading("The causes"), table(told)]
    drawn = {e.name: e for e in p.evidence}
    said: set[str] = set()
    for finding, sentence in zip(document["findings"], words.causes(document), strict=True):
        e = drawn.get(words.name_of(finding))
        if sentence not in said:  # two recordings may have one fault
            blocks.append(paragraph(sentence))
            blocks += [] if e is None else [figure(evidence_figure(e), _alt(e))]
        said.add(sentence)
    return blocks + [paragraph(s) for s in document.get("about", {}).get("explains", ())]


def _gain(p: Pictured) -> list[str]:
    if p.gain is None:
        return []
    blocks = [subheading("What mending gains"), table(gain_table(p.gain))]
    if p.before is not None and p.after is not None and p.gain.worst is not None:
        w = p.gain.worst
        name = p.names[w.source] if w.source < len(p.names) else ""
        drawn = stretch_figure(p.before, p.after, w, name)
        blocks.append(figure(drawn, f"The worst stretch of {w.axis}, before and after"))
    if p.replayed:
        blocks.append(table(replayed_table(p.replayed)))
    return blocks


def _left(document: Document, p: Pictured) -> list[str]:
    blocks = [paragraph(s) for s in (*words.written(document), *words.kept_within(document))]
    blocks += [paragraph(s) for s in words.unadopted(document)]
    if p.leftovers:
        blocks += [subheading("What is left"), *(map(paragraph, words.leftovers(document)))]
        blocks.append(table(leftover_table(p.leftovers)))
        blocks += [figure(evidence_figure(e), _alt(e)) for e in p.leftover_evidence]
    hidden = [paragraph(s) for s in words.still_hidden(document)]
    return [*blocks, subheading("What is still hidden"), *hidden] if hidden else blocks


def how_wrong_table(w: HowWrong) -> Grid:
    """RMSE per axis and horizon, each beside its floor."""
    rows = [
        [f"{h:g}", *(fixed(float(x[k, i]), 3) for i in range(3) for x in (w.rmse_deg, w.floor_deg))]
        for k, h in enumerate(w.horizons_s)
    ]
    notes = [
        f"From states re-estimated every 50 ms. Floor: what noise alone leaves, by {w.floor_by}."
    ]
    notes += [
        f"Worst stretch of {s.axis}: {s.start_s:.1f} to {s.stop_s:.1f} s of {s.recording}, "
        f"RMSE {fixed(s.rmse_deg, 2, '°')} over 1 s."
        for s in w.worst
    ]
    heads = ["s ahead", *(f"{a} {x}" for a in AXES for x in ("RMSE", "floor"))]
    return Grid("How wrong the simulation is, degrees", heads, rows, notes, text_columns=0)


def gain_table(g: Gain) -> Grid:
    """RMSE before and after with the interval of the difference, and the likelihood's gain."""
    rows = []
    for axis in AXES:
        fall = g.rmse_deg[axis]
        numbers = (g.before[axis], g.after[axis])
        span = NONE if fall is None else f"{fixed(fall.low, 3)} … {fixed(fall.high, 3)}"
        less = NONE if fall is None else fixed(fall.value, 3, sign=True)
        rows.append([axis, *(NONE if v is None else fixed(v, 3) for v in numbers), less, span])
    L = g.log_likelihood
    notes = [
        f"On {'hold-out recordings' if g.on == 'holdout' else 'blocks of the flight left out'}, "
        "1 s ahead, against the base simulation refitted; intervals of 95 %, by bootstrap over "
        "cells of two seconds.",
    ]
    if L is not None:
        notes.append(
            f"Log-likelihood won there: {fixed(L.value, 1, sign=True)} "
            f"({fixed(L.low, 1)} … {fixed(L.high, 1)})."
        )
    heads = ["axis", "before °", "after °", "less by °", "95 %"]
    return Grid("RMSE on data not seen", heads, rows, notes, text_columns=1)


def leftover_table(leftovers: Sequence[Leftover]) -> Grid:
    """What no named cause explains."""
    rows = [
        [
            r.axis,
            words.variable(r.depends_on),
            f"{100 * r.share:.0f}",
            f"{r.confidence:.4f}",
            r.like or NONE,
            words.variable(", ".join(r.also)) or NONE,
        ]
        for r in leftovers
    ]
    notes = ["Share: of the variance of the axis' residual torque."]
    heads = ["torque on", "depends on", "share %", "confidence", "like", "or on"]
    return Grid("What is left and has no name", heads, rows, notes, 2, prose_columns=2)


def replayed_table(replayed: Sequence[Replayed]) -> Grid:
    """Table II: overshoot and steady error in the experiment, before and after."""
    rows = [
        [r.recording, r.axis, *(fixed(v, 2) for v in (*r.overshoot_deg, *r.steady_error_deg))]
        for r in replayed
    ]
    three = ("measured", "before", "after")
    heads = ["recording", "axis", *(f"{w} {x}" for w in ("overshoot", "error") for x in three)]
    notes = ["Closed-loop replay of the recording's own references; degrees."]
    return Grid("Table II before and after", heads, rows, notes, text_columns=2)


def _alt(e: Evidence) -> str:
    return f"Residual {e.axis} torque against {e.depends_on}, with {e.name} as fitted"
