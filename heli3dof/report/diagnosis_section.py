"""A diagnosis as a section of the HTML report: what is wrong, the causes, each with its picture.

The tables that come from the contract's document are made elsewhere and passed in; here stand
those of how wrong, of Table II before and after and of what is left, and the figures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from heli3dof.axes import AXES
from heli3dof.diagnosis.gain import Gain, HeldOut
from heli3dof.diagnosis.gain_replay import Replayed
from heli3dof.diagnosis.how_wrong import HowWrong
from heli3dof.diagnosis.leftover import Leftover
from heli3dof.diagnosis.torque_evidence import Evidence
from heli3dof.report.diagnosis_figures import evidence_figure, stretch_figure
from heli3dof.report.grid import NONE, Grid, fixed
from heli3dof.report.html import Section, figure, paragraph, subheading, table


@dataclass(frozen=True, eq=False)
class Pictured:
    """All that the section draws; what is None or empty is left out."""

    wrong: HowWrong | None = None
    evidence: Sequence[Evidence] = ()
    """Of the findings, then of the leftovers"""
    leftovers: Sequence[Leftover] = ()
    gain: Gain | None = None
    before: HeldOut | None = None
    after: HeldOut | None = None
    replayed: Sequence[Replayed] = ()
    names: Mapping[int, str] | None = None
    """Names of the held-out recordings by number"""


def diagnosis_section(
    p: Pictured, tables: Sequence[Grid | str] = (), title: str = "Diagnosis"
) -> Section:
    """The section: ``tables`` (and sentences) first, then tables and figures of ``p``."""
    blocks = [table(t) if isinstance(t, Grid) else paragraph(t) for t in tables]
    if p.wrong is not None:
        blocks.append(table(how_wrong_table(p.wrong)))
    if p.evidence:
        blocks.append(subheading("The causes, as they are seen"))
        blocks += [figure(evidence_figure(e), _alt(e)) for e in p.evidence]
    if p.leftovers:
        blocks.append(table(leftover_table(p.leftovers)))
    if p.gain is not None:
        blocks += [subheading("What mending gains"), table(gain_table(p.gain))]
        if p.before is not None and p.after is not None and p.gain.worst is not None:
            w = p.gain.worst
            name = (p.names or {}).get(w.source, "")
            drawn = stretch_figure(p.before, p.after, w, name)
            blocks.append(figure(drawn, f"The worst stretch of {w.axis}, before and after"))
    if p.replayed:
        blocks.append(table(replayed_table(p.replayed)))
    return Section(title, blocks)


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
        f"Log-likelihood won there: {fixed(L.value, 1, sign=True)} "
        f"({fixed(L.low, 1)} … {fixed(L.high, 1)}).",
    ]
    heads = ["axis", "before °", "after °", "less by °", "95 %"]
    return Grid("RMSE on data not seen", heads, rows, notes, text_columns=1)


def leftover_table(leftovers: Sequence[Leftover]) -> Grid:
    """What no named cause explains."""
    rows = [
        [
            r.axis,
            r.depends_on.replace("_", " ").replace("*", " × "),
            f"{100 * r.share:.0f}",
            f"{r.confidence:.4f}",
            r.like or NONE,
            ", ".join(r.also).replace("_", " ").replace("*", " × ") or NONE,
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
