"""Make the tables of an identification, and the summary that the terminal shows.

The tables give parameters, factored transfer functions and poles with standard deviations, fits on
held-out data, residual tests, and the model orders tried.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from heli3dof.axes import AXES, ROLL
from heli3dof.identification.result import SUMMARY_HORIZON_S, Identification
from heli3dof.model.parameter_units import split_unit
from heli3dof.report.text.number_format import NONE, fixed, significant
from heli3dof.report.text.table import Grid

MAX_CORRELATION = 0.8
"""Absolute correlation above which a pair of estimated parameters gets a note (a convention)"""


def identification_tables(found: Identification) -> list[Grid]:
    """Return an identification's tables that are not empty, the parameters first."""
    grids = [
        parameters_table(found),
        transfer_functions_table(found),
        poles_table(found),
        fits_table(found),
        residuals_table(found),
    ]
    return [g for g in grids if g.rows]


def identification_summary(found: Identification) -> list[str | Grid]:
    """Return what `heli3dof identify` prints without --verbose."""
    lines: list[str | Grid] = [_scores(found)]
    if found.residuals:
        passed = ", ".join(t.name for t in found.residuals if t.passed)
        failed = (
            f"Residual test not passed: {t.name} (past data predict {100 * t.share:.0f} % of the "
            "innovations' variance)."
            for t in found.residuals
            if not t.passed
        )
        lines.append(" ".join([*([f"Residual tests passed: {passed}."] * bool(passed)), *failed]))
    parameters = parameters_table(found, brief=True)
    transfer = transfer_functions_table(found, only_direct=True)
    return [*lines, *(g for g in (parameters, transfer) if g.rows)]


def _scores(found: Identification) -> str:
    """Return a sentence on the fit (%) to held-out data: predictions and closed-loop replay."""
    metrics, name = found.metrics, f"Model {found.model.name}"
    ahead = metrics.prediction.get(SUMMARY_HORIZON_S)
    if ahead is None or np.isnan(ahead.fit_percent).all():
        return f"{name}: there are no held-out data to evaluate it."
    replay = f"closed-loop replay {_by_axis(metrics.replay.fit_percent)}"
    if metrics.replay_note:
        replay = f"closed-loop replay {metrics.replay_note}"
    return (
        f"{name}, fit on held-out data: {SUMMARY_HORIZON_S:g} s predictions "
        f"{_by_axis(ahead.fit_percent)}; {replay}."
    )


def _by_axis(fits: np.ndarray) -> str:
    return ", ".join(f"{a} {fixed(float(v), 0, ' %')}" for a, v in zip(AXES, fits, strict=True))


def parameters_table(found: Identification, *, brief: bool = False) -> Grid:
    """Return a table of the estimates with standard deviations and Cramér–Rao bounds.

    ``brief`` leaves out the bounds and the effects that are not significant. An effect is not
    significant if its first parameter is within two standard deviations of the value that means "no
    effect". A note names the effects left out.
    """
    parameters = found.found.parameters
    sizes = {_short(name): p for name, p in reversed(list(parameters.items()))}  # first parameters
    significant_terms = {
        term
        for term, p in sizes.items()
        if not brief or term in parameters or abs(p.value - p.nominal) > 2 * p.std
    }
    shown = {name: p for name, p in parameters.items() if _short(name) in significant_terms}
    has_bounds = not brief and any(np.isfinite(p.bound) for p in shown.values())
    if brief:
        names = [n for n in dict.fromkeys(map(_short, parameters)) if n not in significant_terms]
        notes = [f"Not significant: {', '.join(names)}."] * bool(names)
    else:
        bound = "; bound: the Cramér–Rao bound on it, for encoders with white rounding noise"
        notes = [f"σ: standard deviation{bound if has_bounds else ''}."]
        notes += [p.verdict for p in shown.values() if p.verdict]
        notes += _correlated(list(parameters), found.found.correlation)
    count = Counter(map(_short, parameters))
    rows = [
        [
            _short(name) if count[_short(name)] == 1 else split_unit(name)[0],
            significant(p.value, p.std),
            significant(p.std, p.std),
            *([significant(p.bound, p.std)] if has_bounds else []),
            significant(p.nominal),
            "" if p.unit == "–" else p.unit,
        ]
        for name, p in shown.items()
    ]
    heads = ["parameter", "value", "σ", *(["bound"] if has_bounds else []), "nominal", "unit"]
    return Grid("Parameters", heads, rows, notes=notes, text_columns=1, prose_columns=1)


def transfer_functions_table(found: Identification, *, only_direct: bool = False) -> Grid:
    """Return a table of the factored transfer functions in °/V, rows by output and input.

    ``only_direct``: the table has only the transfer functions from the sum of the voltages to roll,
    and from their difference to pitch and yaw. A note states whether the others are zero.
    """
    title = "Transfer functions, °/V, coefficients ± standard deviation"
    if found.found.transfer is None:
        return Grid(title, ["output / input", "transfer function"], [])
    direct = [f for f in found.factored if (f.output == AXES[ROLL]) == (f.input == "sum")]
    cross = [f for f in found.factored if f not in direct]
    notes = ["sum: both voltages +1 V; difference: front +1 V, back −1 V."]
    if only_direct and all(f.gain == 0 for f in cross):
        notes.append("The others are 0, within two standard deviations.")
    elif only_direct:
        notes.append("The others: --verbose.")
    shown = direct if only_direct else found.factored
    rows = [[f"{f.output} / {f.input}", str(f)] for f in shown]
    return Grid(
        title,
        ["output / input", "transfer function"],
        rows,
        notes=notes,
        prose_columns=1,
    )


def _short(name: str) -> str:
    """Return a dotted parameter name without its last part: ``motor.lag.x`` gives ``motor.lag``."""
    return name.rpartition(".")[0] or name


def _correlated(names: list[str], correlation: np.ndarray | None) -> list[str]:
    """Return a sentence per pair of parameters with |correlation| above `MAX_CORRELATION`."""
    if correlation is None:
        return []
    return [
        f"{_short(names[i])} and {_short(names[j])} are correlated by "
        f"{fixed(float(correlation[i, j]), 2, sign=True)}."
        for i in range(len(names))
        for j in range(i)
        if abs(correlation[i, j]) > MAX_CORRELATION
    ]


def poles_table(found: Identification) -> Grid:
    """Return a table of the continuous-time poles (1/s); a conjugate pair has one row."""
    rows = []
    for pole in found.poles:
        re, im = pole.value.real, pole.value.imag
        if im < 0:
            continue
        pair = im > 0
        value = f"{re:+.4g}" + (f" ± {im:.4g}j" if pair else "")
        known = pole.std_real == pole.std_real
        std = f"{pole.std_real:.2g}" + (f", {pole.std_imag:.2g}j" if pair else "")
        rows.append([value.replace("-", "−"), std if known else NONE])
    heads = ["pole, 1/s", "standard deviation"]
    return Grid("Poles, continuous time", heads, rows, text_columns=0)


def fits_table(found: Identification) -> Grid:
    """Return a table of the model's fit (%) to held-out data, with a row per axis.

    It has a column for each prediction horizon, and one for the closed-loop simulation (replay).
    """
    metrics = found.metrics
    scores = {
        ("one step" if h == 0 else f"{h:g} s ahead"): s for h, s in metrics.prediction.items()
    }
    scores["loop replay"] = metrics.replay
    rows = [
        [axis, *(fixed(float(s.fit_percent[i]), 1) for s in scores.values())]
        for i, axis in enumerate(AXES)
    ]
    notes = [f"{found.prepared.split}."]
    if metrics.replay_note:
        notes.append(f"Loop replay: {metrics.replay_note}.")
    return Grid("Fit on held-out data, %", ["axis", *scores], rows, notes=notes, text_columns=1)


def residuals_table(found: Identification) -> Grid:
    """Return a table of the residual tests: whiteness, independence from past inputs."""
    rows = [
        [
            test.name,
            "passed" if test.passed else "not passed",
            f"{test.statistic:.4g}",
            f"{test.bound:.4g}",
            f"{test.p_value:.2g}",
            f"{100 * test.share:.1f}",
        ]
        for test in found.residuals
    ]
    return Grid(
        "Residual tests, on held-out data",
        ["test", "verdict", "χ²", "99 % bound", "p", "explained %"],
        rows,
        notes=["Explained: the share of the innovations' variance that the tested past explains."],
        text_columns=2,
    )


def candidates_table(found: Identification) -> Grid:
    """Return a table of the tried model orders and sampling intervals: fit (%), log-likelihood."""
    rows = [
        [
            str(c.order),
            f"{1e3 * c.interval_s:g}",
            _cell(c.score),
            _cell(c.log_likelihood),
            c.problem,
        ]
        for c in found.found.candidates
    ]
    return Grid(
        "Candidate orders and sampling intervals, on the training recordings",
        ["order", "interval ms", "score %", "log likelihood", "problem"],
        rows,
        text_columns=0,
        prose_columns=1,
    )


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}" if np.isfinite(value) else NONE
    return NONE if value is None else str(value)
