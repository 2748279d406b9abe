"""``compare --json``: the comparison as one JSON document, schema ``heli3dof.comparison/1``.

::

    schema, horizons_s, warnings, verdict[] (sentences)
    flights[]      recording, digest, duration_s, profile
                   loop ("replayed" | "not replayed"), why_not_replayed
                   experiment.<axis>      the six metrics, the step they describe, all steps
                   models[]               name, kind, diverged_at_s, unstable_poles, cannot[]
                                          (sentences: what could not be computed, and why)
                     axes.<axis>          the six metrics, difference (the same six, model minus
                                          experiment), replay_rmse_deg
                     prediction           rmse_deg.<horizon>.<axis>, over_window_deg.<axis> (RMSE
                                          over all horizons from 0 to the longest)
                   held_still             the same keys as prediction, for a baseline: each angle
                                          keeps its last measured value
    published[]    a number printed in the paper (value_deg), heli3dof's simulated number
                   (ours_deg), whether the printed number is reproducible, and the reason

``<axis>`` is ``roll``, ``pitch`` or ``yaw``, ``<horizon>`` a prediction horizon in s. The six
metrics are ``peak_deg overshoot_deg overshoot_percent steady_error_deg rise_time_s
settling_time_s``. `heli3dof.comparison.metrics` defines them. Undefined numbers are null.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from heli3dof.axes import AXES
from heli3dof.comparison.metrics import AxisMetrics, StepMetrics
from heli3dof.comparison.verdict import verdict
from heli3dof.json_values import jsonable

if TYPE_CHECKING:
    from heli3dof.comparison.result import (
        Comparison,
        FlightComparison,
        ModelComparison,
        PredictionError,
    )

SCHEMA = "heli3dof.comparison/1"


class PublishedRow(Protocol):
    """A number printed in the paper and the same number simulated here; `to_dict` returns both."""

    def to_dict(self) -> dict[str, Any]: ...


def comparison_document(
    comparison: Comparison, published: Iterable[PublishedRow] = ()
) -> dict[str, Any]:
    """Return the comparison as a dict of JSON types, with the keys of the module's docstring.

    ``published``: the paper's numbers, each with the number simulated here. Without any, the
    dict has no key ``published``.
    """
    rows = [row.to_dict() for row in published]
    document: dict[str, Any] = jsonable(
        {
            "schema": SCHEMA,
            "horizons_s": comparison.horizons_s,
            "flights": [_flight(f) for f in comparison.flights],
            "warnings": comparison.warnings,
            "verdict": verdict(comparison),
            **({"published": rows} if rows else {}),
        }
    )
    return document


def _flight(flight: FlightComparison) -> dict[str, Any]:
    recording = flight.recording
    return {
        "recording": recording.name,
        "digest": recording.digest,
        "duration_s": recording.duration,
        "profile": recording.profile.name,
        "loop": flight.loop,
        "why_not_replayed": flight.why,
        "experiment": {axis: _axis(flight.experiment[axis]) for axis in AXES},
        "models": [_model(flight, m) for m in flight.models],
        "held_still": _prediction(flight.constant_angles),
    }


def _model(flight: FlightComparison, model: ModelComparison) -> dict[str, Any]:
    axes = None
    if model.metrics is not None and model.replay_rmse_deg is not None:
        axes = {
            axis: {
                **_axis(model.metrics[axis]),
                "difference": flight.difference(model, axis),
                "replay_rmse_deg": model.replay_rmse_deg[i],
            }
            for i, axis in enumerate(AXES)
        }
    return {
        "name": model.name,
        "kind": model.kind,
        "axes": axes,
        "prediction": _prediction(model.prediction),
        "diverged_at_s": model.diverged_at_s,
        "unstable_poles": [{"real": p.real, "imag": p.imag} for p in model.unstable_poles],
        "cannot": model.cannot,
    }


def _axis(metrics: AxisMetrics) -> dict[str, Any]:
    return {
        **metrics.reported.values(),
        "step": _step(metrics.reported),
        "steps": steps_document(metrics),
    }


def steps_document(metrics: AxisMetrics) -> list[dict[str, Any]]:
    """Return the segments of an axis' reference, each with its step metrics, as JSON types."""
    steps: list[dict[str, Any]] = jsonable([{**_step(s), **s.values()} for s in metrics.steps])
    return steps


def _step(step: StepMetrics) -> dict[str, Any]:
    return {
        "kind": step.kind,
        "start_s": step.start_s,
        "stop_s": step.stop_s,
        "from_deg": step.from_deg,
        "set_deg": step.set_deg,
    }


def _prediction(error: PredictionError | None) -> dict[str, Any] | None:
    if error is None:
        return None
    return {
        "rmse_deg": {f"{h:g}": _per_axis(v) for h, v in error.ahead_deg.items()},
        "over_window_deg": _per_axis(error.over_window_deg),
        "window_s": error.window_s,
    }


def _per_axis(values: np.ndarray) -> dict[str, float]:
    return dict(zip(AXES, values.tolist(), strict=True))
