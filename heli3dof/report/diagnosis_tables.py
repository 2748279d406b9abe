"""A diagnosis for the terminal: how wrong, the causes, what mending gains, what is left, what next.

Written from the contract's document (``heli3dof.diagnosis/1``) alone, so that a diagnosis read back
from a file is told like one just made. Sentences are those of `heli3dof.report.diagnosis_text`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from heli3dof.axes import AXES
from heli3dof.report import diagnosis_text as words
from heli3dof.report.diagnosis_text import Document, name_of, number
from heli3dof.report.text_table import NONE, Grid, fixed


def split_unit(key: str) -> tuple[str, str]:
    """A contract key's name and its unit: ``damping_Nms_per_rad`` → (``damping``, ``N·m·s/rad``).

    >>> split_unit("torque_Nm"), split_unit("ratio")
    (('torque', 'N·m'), ('ratio', ''))
    """
    for ending, unit in UNITS.items():
        if key.endswith(f"_{ending}"):
            return key[: -len(ending) - 1], unit
    return key, ""


UNITS = {
    "Nms_per_rad": "N·m·s/rad",
    "Nms2_per_rad2": "N·m·s²/rad²",
    "Nm_per_rad": "N·m/rad",
    "Nms_per_V": "N·m·s/V",
    "s_per_V": "s/V",
    "s_per_m": "s/m",
    "per_V": "1/V",
    "Nm": "N·m",
    "kg": "kg",
    "deg": "°",
    "rad": "rad",
    "Hz": "Hz",
    "V": "V",
    "m": "m",
    "s": "s",
}


def significant(value: float | None, std: float | None = None) -> str:
    """A value to the digit that its deviation makes meaningless (two digits of the deviation).

    >>> significant(0.030123, 0.00042), significant(1234.5, 20.0), significant(None)
    ('0.03012', '1234', '–')
    """
    if value is None or not math.isfinite(value):
        return NONE
    if std is None or not math.isfinite(std) or std <= 0:
        return f"{value:.4g}".replace("-", "−")
    digits = max(0, 1 - math.floor(math.log10(std)))
    return fixed(value, digits)


def diagnosis_tables(document: Document) -> list[Grid | str]:
    """Grids and sentences in reading order; those that have nothing to say are left out."""
    grids = (wrong(document), findings(document), gains(document), calibration(document))
    told = [grid for grid in grids if grid.rows]
    out: list[Grid | str] = [words.verdict(document), *words.faults(document)]
    out += words.unmeasured(document)
    for grid in told:
        out.append(grid)
        if grid is grids[1]:
            out += dict.fromkeys(words.causes(document))  # two recordings may have one fault
    out += words.perhaps_off(document)
    out += document.get("about", {}).get("explains", ())
    out += words.written(document)
    said_of = (words.kept_within, words.leftovers, words.still_hidden, words.unadopted)
    for said in (*said_of, words.next_steps):
        out += said(document)
    return out


def wrong(document: Document) -> Grid:
    """How wrong the simulation is as its profile has it, beside what noise alone would do."""
    error = document["simulation_error"]
    rows = [
        [axis, _degrees(error[axis]["rmse_deg"]), _degrees(error[axis]["noise_floor_deg"])]
        for axis in AXES
        if error[axis]["rmse_deg"] is not None
    ]
    seconds = next((e["horizon_s"] for e in error.values()), 1.0)
    return Grid(
        f"How wrong the simulation is, predicting {seconds:g} s ahead (RMS)",
        ["axis", "simulation °", "noise alone °"],
        rows,
        notes=["The simulation as the profile has it, nothing fitted.", *_worst(error)],
    )


def _worst(error: Document) -> list[str]:
    """Where it is furthest off, in one line."""
    said = [
        f"{axis} {fixed(w['start_s'], 1)} to {fixed(w['stop_s'], 1)} s of {w['recording']} "
        f"({fixed(w['rmse_deg'], 2, '°')})"
        for axis in AXES
        for w in error[axis].get("worst", ())
    ]
    return [f"Worst: {', '.join(said)}."] if said else []


def findings(document: Document) -> Grid:
    """The causes: size, deviation, and what each gains; how sure they are is said in words."""
    rows = []
    for f in document["findings"]:
        won = fixed(number(f["gain"]["holdout_log_likelihood"]), 0)
        for key, sized in f["parameters"].items() or [("", {"value": None, "std": None})]:
            what, unit = split_unit(key)
            value, std = sized["value"], sized["std"]
            size = [significant(value, std), significant(std, std)]
            rows.append([name_of(f), what, *size, unit, won])
            won = ""
    return Grid(
        "Causes, strongest first",
        ["cause", "what", "size", "±", "unit", "ln\u00a0L"],
        rows,
        notes=["±: one standard deviation; ln L: log-likelihood won by the cause."] if rows else [],
        text_columns=2,
    )


def gains(document: Document) -> Grid:
    """The base simulation refitted against the extended one, with the interval of what is won."""
    heads = ["axis", "before °", "after °", "less by °", "95 % interval", "noise alone °"]
    if not words.adopted(document):
        return Grid("", heads, [])
    gain = document["gain"]
    error = gain["holdout_rmse_deg"]
    before, after, floor = (error[k] for k in ("before", "after", "noise_floor"))
    fall = gain.get("rmse_reduction_deg", {})
    rows = []
    for axis in AXES:
        if before.get(axis) is None:
            continue
        won = fall.get(axis) or {"value": None, "interval": (None, None)}
        sides = (_degrees(side.get(axis)) for side in (before, after))
        less = fixed(number(won["value"]), 3, sign=True)
        rows.append([axis, *sides, less, interval(won["interval"]), _degrees(floor.get(axis))])
    where = "the held-out recordings" if document["holdout"] else "blocks left out of the fit"
    if gain.get("measured_on") == "the recordings themselves":
        where = "the recordings that were fitted, which flatters"
    notes = [
        f"Measured on {where}; before: the base simulation with its own parameters refitted, "
        "so that nothing here is mere calibration."
    ]
    L = gain.get("holdout_log_likelihood")
    if L is not None:
        span = gain.get("holdout_log_likelihood_interval", (None, None))
        notes.append(f"Log-likelihood won there: {fixed(L, 0, sign=True)} ({interval(span, 0)}).")
    title = f"What mending gains, predicting {gain['horizon_s']:g} s ahead (RMS)"
    return Grid(title, heads, rows, notes)


def interval(ends: Sequence[float | None], digits: int = 3) -> str:
    """Two ends as people read them; a dash where there is none.

    >>> interval((0.1, 0.25)), interval((None, None))
    ('0.100 … 0.250', '–')
    """
    low, high = (number(x) for x in ends)
    if not (math.isfinite(low) and math.isfinite(high)):
        return NONE
    return f"{fixed(low, digits)} … {fixed(high, digits)}"


def calibration(document: Document) -> Grid:
    """The base simulation's own parameters, refitted."""
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
        ["parameter", "nominal", "value", "±", "unit", "off"],
        rows,
    )


def _degrees(value: float | None) -> str:
    return fixed(number(value), 3)
