"""Make the tables of a diagnosis, and its terminal output: tables and sentences in reading order.

Each function's argument ``document`` is the JSON document of ``diagnose --json`` (schema
``heli3dof.diagnosis/1``), so a diagnosis can also be printed from its file.
`heli3dof.report.text.diagnosis_sentences` writes the sentences.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from heli3dof.axes import AXES
from heli3dof.diagnosis import name_of
from heli3dof.report.text import diagnosis_sentences as words
from heli3dof.report.text.diagnosis_sentences import Document
from heli3dof.report.text.number_format import NONE, fixed, significant
from heli3dof.report.text.table import Grid

CAUSES = "Causes, strongest first"


def diagnosis_tables(document: Document) -> list[Grid | str]:
    """Return a diagnosis' tables and sentences in reading order; empty tables are left out."""
    out: list[Grid | str] = [words.verdict(document), *words.faults(document)]
    out += words.gain(document) if words.states_refit(document) else ()
    out += words.calibration_change(document)
    out += words.limits(document)
    for grid in (simulation_error(document), findings(document), gains(document)):
        out += [grid] if grid.rows else []
        if grid.title == CAUSES:
            out += dict.fromkeys(words.causes(document))  # two recordings may share a fault
    grid = calibration(document)
    out += [grid] if grid.rows else []
    out += words.calibration_doubts(document)
    out += document.get("about", {}).get("explains", ())
    for sentences in (
        words.equation_changes,
        words.kept_terms,
        words.unmodelled_effects,
        words.slow_noise,
        words.model_deviations,
        words.not_adopted,
        words.next_steps,
    ):
        out += sentences(document)
    return out


def simulation_error(document: Document) -> Grid:
    """Return a table by axis: RMSE of predictions with the rig profile's values, noise floor."""
    error = document["simulation_error"]
    rows = [
        [axis, fixed(error[axis]["rmse_deg"], 3), fixed(error[axis]["noise_floor_deg"], 3)]
        for axis in AXES
        if error[axis]["rmse_deg"] is not None
    ]
    seconds = next((e["horizon_s"] for e in error.values()), 1.0)
    return Grid(
        f"Simulation error: RMSE of {seconds:g} s predictions",
        ["axis", "RMSE °", "noise floor °"],
        rows,
        notes=["The simulation has the profile's parameters; nothing is fitted.", *_worst(error)],
    )


def _worst(error: Document) -> list[str]:
    """Return a sentence on the parts of recordings with the largest errors; empty if unknown."""
    stretches = [
        f"{axis} {fixed(w['start_s'], 1)} to {fixed(w['stop_s'], 1)} s of {w['recording']} "
        f"({fixed(w['rmse_deg'], 2, '°')})"
        for axis in AXES
        for w in error[axis].get("worst", ())
    ]
    return [f"Worst: {', '.join(stretches)}."] if stretches else []


def findings(document: Document) -> Grid:
    """Return a table of the causes: parameter ± standard deviation, increase of log-likelihood."""
    rows = []
    for f in document["findings"]:
        gain = fixed(f["gain"]["holdout_log_likelihood"], 0)
        for key, estimate in f["parameters"].items() or [("", {"value": None, "std": None})]:
            parameter, unit = words.quantity_and_unit(f, key)
            size = words.size_and_std(key, estimate)
            rows.append([name_of(f), parameter, *size, unit, gain])
            gain = ""
    note = "±: one standard deviation. Δ ln L: gain in log-likelihood on held-out data."
    return Grid(
        CAUSES,
        ["cause", "parameter", "value", "±", "unit", "Δ\u00a0ln\u00a0L"],
        rows,
        notes=[note] if rows else [],
        text_columns=2,
    )


def gains(document: Document) -> Grid:
    """Return a table of held-out RMSE (degrees) by axis, without and with the diagnosed causes."""
    heads = ["axis", "before °", "after °", "reduction °", "95 % interval", "noise floor °"]
    if not words.adopted(document):
        return Grid("", heads, [])
    gain = document["gain"]
    error = gain["holdout_rmse_deg"]
    before, after, floor = (error[k] for k in ("before", "after", "noise_floor"))
    rows = []
    for axis in AXES:
        if before.get(axis) is None:
            continue
        fall = gain.get("rmse_reduction_deg", {}).get(axis) or {}
        reduction = fixed(fall.get("value"), 3, sign=True)
        span = interval(fall.get("interval", (None, None)))
        sides = (fixed(side.get(axis), 3) for side in (before, after))
        rows.append([axis, *sides, reduction, span, fixed(floor.get(axis), 3)])
    notes = [
        f"Measured on {words.measured_on(document)}. Before: the base simulation with its own "
        "parameters refitted; calibration alone is therefore not counted as a gain."
    ]
    L = gain.get("holdout_log_likelihood")
    if L is not None:
        span = interval(gain.get("holdout_log_likelihood_interval", (None, None)), 0)
        notes.append(f"Gain in log-likelihood there: {fixed(L, 0, sign=True)} ({span}).")
    title = f"Gain of the extended model: RMSE of {gain['horizon_s']:g} s predictions"
    return Grid(title, heads, rows, notes)


def interval(ends: Sequence[float | None], digits: int = 3) -> str:
    """Format the two ends of an interval; a dash if one is missing.

    >>> interval((0.1, 0.25)), interval((None, None))
    ('0.100 … 0.250', '–')
    """
    texts = [fixed(end, digits) for end in ends]
    return NONE if NONE in texts else " … ".join(texts)


def calibration(document: Document) -> Grid:
    """Return a table of the refitted rig parameters and their change (%) from the profile."""
    rows = []
    for c in document["calibration"]:
        nominal, value = c["nominal"], c["value"]
        off = (value / nominal - 1) * 100 if nominal and value is not None else math.nan
        rows.append(
            [
                c["parameter"],
                significant(nominal),
                significant(value, c["std"]),
                significant(c["std"], c["std"]),
                c["unit"],
                fixed(off, 1, " %", sign=True),
            ]
        )
    return Grid(
        "Calibration of the base simulation",
        ["parameter", "nominal", "value", "±", "unit", "difference"],
        rows,
    )
