"""State a comparison's result in a few sentences: which model is best, and whether it is useful.

The sentences compare two errors of the models, in degrees (RMS over the recordings): those of
predictions `HORIZON_S` ahead, and those of the closed-loop replay. If a model's error is at most
`EQUAL` times the smallest error, this model counts as equally good as the best model. A model's
prediction is useful only if its error is smaller than that of a baseline. The baseline predicts
that each angle keeps its last measured value.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from heli3dof.arrays import FloatArray
from heli3dof.axes import AXES
from heli3dof.comparison.prediction import CONSTANT_ANGLES

if TYPE_CHECKING:
    from heli3dof.comparison.result import Comparison

HORIZON_S = 1.0
"""s: horizon of the predictions, as in a diagnosis. 0.1 s ahead, all models are about equal."""
EQUAL = 1.05
"""Ratio of two RMSE up to which the models count as equally good (a convention)"""
Errors = Mapping[str, FloatArray]
"""Model → RMSE (3,) in degrees; NaN where the model has none"""


def verdict(comparison: Comparison) -> tuple[str, ...]:
    """Return sentences that name each axis's best model in prediction and in closed-loop replay."""
    names = list(dict.fromkeys(m.name for f in comparison.flights for m in f.models))
    if not names:
        return ("No model was compared.",)
    horizon = min(comparison.horizons_s, key=lambda h: abs(h - HORIZON_S), default=HORIZON_S)
    ahead = {h: prediction_errors(comparison, h) for h in comparison.horizons_s}
    sentences = []
    if horizon in ahead:
        sentences.append(_best_models(ahead[horizon], f"predictions {horizon:g} s ahead"))
        sentences += _against_constant_angles(ahead, horizon)
    identified = any(f.flown.identified_controller is not None for f in comparison.flights)
    which = ", controller identified from the log" if identified else ""
    sentences.append(_best_models(replay_errors(comparison), f"closed-loop replay{which}"))
    known = tuple(s for s in sentences if s)
    return known or ("No model could be compared; the warnings state why.",)


def prediction_errors(comparison: Comparison, horizon_s: float) -> dict[str, FloatArray]:
    """Return {model: RMSE (3,) in degrees of its predictions ``horizon_s`` s ahead}.

    One of the models is the baseline `CONSTANT_ANGLES`, which predicts that the angles stay
    constant.
    """
    return _rms_over_flights([
        {n: None if p is None else p.ahead_deg.get(horizon_s) for n, p in f.predictions.items()}
        for f in comparison.flights
    ])  # fmt: skip


def replay_errors(comparison: Comparison) -> dict[str, FloatArray]:
    """Return {model: RMSE (3,) in degrees of its closed-loop simulation (replay)}."""
    return _rms_over_flights(
        [{m.name: m.replay_rmse_deg for m in f.models} for f in comparison.flights]
    )


def _rms_over_flights(table: Sequence[Mapping[str, FloatArray | None]]) -> dict[str, FloatArray]:
    """Return {model: root mean square (3,) of the model's errors over the flights}.

    ``table`` has, for each flight, {model: its error (3,)}; an unknown error is None. The result
    omits models whose errors are all unknown. The other models are compared on the same flights.
    These are the flights in which the errors of all these models are known. If there is no such
    flight, the function uses for each model the flights in which this model's error is known.
    """
    usable = {name for row in table for name, e in row.items() if e is not None}
    common = [r for r in table if all(r.get(name) is not None for name in usable)] or table
    pooled = {}
    for name in (n for n in dict.fromkeys(n for row in table for n in row) if n in usable):
        errors = [e for row in common if (e := row.get(name)) is not None]
        if errors:
            pooled[name] = np.asarray(np.sqrt(np.mean(np.square(errors), axis=0)))
    return pooled


def _best_models(errors: Errors, what: str) -> str:
    """Return a sentence that names the best model on each axis; "" if no error is known.

    The sentence also gives the smallest error on the axis, and the error of one other model for
    comparison. This other model is "hover", the paper's model. If "hover" is missing or among the
    best models, the other model is the second-best model. If there is only one model, the sentence
    gives its errors. ``what`` describes the ``errors``, for example "closed-loop replay".
    """
    models = {name: e for name, e in errors.items() if name != CONSTANT_ANGLES}
    groups: dict[tuple[str, ...], list[str]] = {}
    for i, axis in enumerate(AXES):
        known = {name: float(e[i]) for name, e in models.items() if np.isfinite(e[i])}
        if not known:
            continue
        best = tuple(name for name, e in known.items() if e <= EQUAL * min(known.values()))
        others = [name for name in known if name not in best]
        other = "hover" if "hover" in others else min(others, key=lambda n: known[n], default="")
        against = f", {other} {_degrees(known[other])}" if other else ""
        smallest = _degrees(min(known.values()))
        size = smallest if len(models) == 1 else f"({smallest}{against})"
        groups.setdefault(best, []).append(f"{axis} {size}")
    if not groups:
        return ""
    if len(models) == 1:
        ((name,), sizes) = next(iter(groups.items()))
        return f"RMSE of {what}, {name}: {', '.join(sizes)}."
    parts = [
        f"{_listed(best)} {'is' if len(best) == 1 else 'are'} best on {', '.join(axes)}"
        for best, axes in groups.items()
    ]
    return f"RMSE of {what}: {'; '.join(parts)}."


def _against_constant_angles(ahead: Mapping[float, Errors], horizon_s: float) -> list[str]:
    """Return sentences that name the models with a larger prediction error than the baseline.

    The baseline `CONSTANT_ANGLES` predicts that each angle keeps its last measured value. The first
    sentence names the models and axes with a larger error at the horizon ``horizon_s`` (s). The
    second sentence names the axes and horizons at which all models have a larger error. ``ahead``:
    {horizon (s): {model: RMSE (3,) in degrees}}.
    """
    models = [n for n in ahead[horizon_s] if n != CONSTANT_ANGLES]
    if CONSTANT_ANGLES not in ahead[horizon_s] or not models:
        return []
    single, every = [], []
    for name in models:
        worse = ahead[horizon_s][name] > ahead[horizon_s][CONSTANT_ANGLES]
        if worse.any():
            single.append(f"{name} on {_listed([AXES[i] for i in np.flatnonzero(worse)])}")
    for i, axis in enumerate(AXES):
        lost = []
        for h, errors in ahead.items():
            still = errors[CONSTANT_ANGLES][i] if CONSTANT_ANGLES in errors else np.nan
            if np.isfinite(still) and all(errors[n][i] > still for n in models if n in errors):
                lost.append(f"{h:g}")
        if len(models) > 1 and lost not in ([], [f"{horizon_s:g}"]):
            every.append(f"{axis} {_listed(lost)} s ahead")
    sentences = []
    if single:
        sentences.append(
            f"Worse than {CONSTANT_ANGLES} {horizon_s:g} s ahead: {'; '.join(single)}."
        )
    if every:
        sentences.append(f"No model is better than {CONSTANT_ANGLES} on {'; '.join(every)}.")
    return sentences


def _degrees(value: float) -> str:
    return f"{value:.2f}°" if value < 10 else f"{value:.0f}°"


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
