"""A diagnosis for the terminal: how wrong, the causes, what mending gains, what is left, what next.

Written from the contract's document (``heli3dof.diagnosis/1``) alone, so that a diagnosis read back
from a file is told like one just made.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from heli3dof.axes import AXES
from heli3dof.report.grid import NONE, Grid, fixed

Document = Mapping[str, Any]

VERDICTS = {
    "explained": "What the simulation gets wrong is explained by the causes below.",
    "nothing_found": "Nothing was found that noise alone would not explain.",
    "ambiguous": "Something is wrong, but this recording cannot tell its possible causes apart.",
    "unexplained": "Something is left that no known cause explains.",
    "not_identifiable": "These recordings hold too little to say what is wrong.",
    "bad_data": "The recording itself is at fault: no physics is blamed before that is mended.",
}
LISTED = 6
"""Names in a sentence before the rest are counted."""


def name_of(finding: Document) -> str:
    """``friction.coulomb`` on ``yaw`` → ``friction.coulomb.yaw``."""
    axis = finding.get("axis")
    return str(finding["effect"]) if axis is None else f"{finding['effect']}.{axis}"


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
    out: list[Grid | str] = [
        f"Verdict: {str(document['verdict']).replace('_', ' ')}. {VERDICTS[document['verdict']]}"
    ]
    out += [str(s) for s in document.get("integrity", ())]
    for grid in (wrong(document), findings(document), gains(document), calibration(document)):
        if grid.rows:
            out.append(grid)
    return [*out, *sentences(document)]


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
        notes=["The simulation as the profile has it, nothing fitted."] if rows else [],
    )


def findings(document: Document) -> Grid:
    """The causes: size, deviation, how sure, and what each gains."""
    rows = []
    for f in document["findings"]:
        name, sure = name_of(f), _sure(f["confidence"])
        for i, (key, number) in enumerate(f["parameters"].items()):
            what, unit = split_unit(key)
            rows.append(
                [
                    name if i == 0 else "",
                    what,
                    significant(number["value"], number["std"]),
                    significant(number["std"], number["std"]),
                    unit,
                    sure if i == 0 else "",
                    fixed(_number(f["gain"]["holdout_log_likelihood"]), 0) if i == 0 else "",
                ]
            )
    return Grid(
        "Causes, strongest first",
        ["cause", "what", "size", "±", "unit", "certainty", "ln L"],
        rows,
        notes=["±: one standard deviation; ln L: log-likelihood won by the cause."] if rows else [],
        text_columns=2,
    )


def gains(document: Document) -> Grid:
    """The base simulation refitted against the extended one."""
    gain = document["gain"]
    error = gain["holdout_rmse_deg"]
    before, after, floor = (error[k] for k in ("before", "after", "noise_floor"))
    if not document["findings"]:
        return Grid("", ["axis"], [])
    rows = [
        [axis, *(_degrees(side.get(axis)) for side in (before, after, floor))]
        for axis in AXES
        if before.get(axis) is not None
    ]
    where = "held-out recordings" if document["holdout"] else "the same flights"
    where = document.get("about", {}).get("gain_measured_on", where)
    return Grid(
        f"What mending gains, predicting {gain['horizon_s']:g} s ahead (RMS)",
        ["axis", "before °", "after °", "noise alone °"],
        rows,
        notes=[
            f"Measured on {where}; before: the base simulation with its own parameters refitted, "
            "so that nothing here is mere calibration."
        ],
    )


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


def sentences(document: Document) -> list[str]:
    """Ties, what could not be seen, what is left and what to fly next."""
    out = []
    for f in document["findings"]:
        if f["tied_with"]:
            others = " or ".join(f["tied_with"])
            out.append(f"{name_of(f)} cannot be told from {others} by these recordings.")
    for rest in document["leftover"]:
        share = _number(rest["share"])
        out.append(
            f"Left over: a torque on {rest['axis']} that depends on "
            f"{str(rest['depends_on']).replace('_', ' ')}"
            + (f", {share * 100:.0f} % of what is unexplained." if math.isfinite(share) else ".")
        )
    dark = list(document["not_identifiable"])
    if dark:
        more = f" and {len(dark) - LISTED} more" if len(dark) > LISTED else ""
        out.append(f"These recordings could not show: {', '.join(dark[:LISTED])}{more}.")
    next_ = document["next_experiment"]
    if next_ is not None:
        out.append(f"Fly next: heli3dof run {next_['plan']} ({next_['why']})")
    return out


def _degrees(value: float | None) -> str:
    return fixed(_number(value), 3)


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _sure(confidence: float | None) -> str:
    """Never 100 %: nothing is.

    >>> _sure(0.9999), _sure(0.873), _sure(None)
    ('> 99 %', '87 %', '–')
    """
    if confidence is None or not math.isfinite(confidence):
        return NONE
    return "> 99 %" if confidence > 0.99 else f"{confidence * 100:.0f} %"
