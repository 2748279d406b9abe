"""`compare`: compare models with recordings, as in Table II and Figures 7–9 of the paper.

If a recording's controller is known, each model is simulated in closed loop with it
(`heli3dof.comparison.replay`). The comparison then contains the model's step metrics and their
differences from the measured ones. The entries of Table II are such differences (erratum E11). With
or without a known controller, the comparison contains the errors of multi-step predictions
(`heli3dof.comparison.prediction`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TypeVar

import numpy as np

from heli3dof.comparison.metrics import metrics_in_flight
from heli3dof.comparison.prediction import (
    HORIZONS_S,
    STEPS_AVERAGED,
    STEPS_DRAWN,
    ConstantAngles,
    Predictions,
    common_rows,
    over_window_deg,
    predictions,
    rmse_deg,
    rows_within,
    stitched,
)
from heli3dof.comparison.replay import Replay, replay
from heli3dof.comparison.result import (
    Comparison,
    FlightComparison,
    ModelComparison,
    PredictionError,
    Trace,
)
from heli3dof.errors import Heli3dofError, UsageError
from heli3dof.identification.row_selection import rows_in_flight
from heli3dof.model.base import Model
from heli3dof.model.control.loop_task import under_control, why_not_replayed
from heli3dof.model.control.voltage_replay import with_known_controller
from heli3dof.model.labels import labels
from heli3dof.recording.logs.corrections import corrected
from heli3dof.recording.recording import Recording
from heli3dof.recording.same_rig import differing_numbers

__all__ = ["Comparison", "FlightComparison", "compare", "compare_flight"]

T = TypeVar("T")
Models = Sequence[Model] | Callable[[Recording], Sequence[Model]]


def compare(
    recordings: Sequence[Recording], models: Models, *, horizons_s: Sequence[float] = HORIZONS_S,
    identify_controller: bool = False,
) -> Comparison:  # fmt: skip
    """Return the comparison of every model with every recording.

    ``models``: the models, or a function that returns the models for a recording. Models that share
    a name get distinct labels (`heli3dof.model.labels`). ``horizons_s``: prediction horizons in s;
    if it is empty, nothing is predicted. ``identify_controller``: identify a linear controller from
    each recording whose profile has none, and replay the recording with it. If a model cannot be
    compared, ``ModelComparison.cannot`` gives the reason; the other models are still compared.
    Raises UsageError if there is no model.
    """
    flights = []
    for r in recordings:
        each = models(r) if callable(models) else models
        if not each:
            raise UsageError(
                "No model was given.",
                cause="the list of models is empty.",
                fix="models=['hover'], or the model of an identification: [identified.model]",
            )
        flights.append(
            compare_flight(r, each, horizons_s=horizons_s, identify_controller=identify_controller)
        )
    return Comparison(tuple(flights), tuple(float(h) for h in horizons_s))


def compare_flight(
    recording: Recording, models: Sequence[Model], *, horizons_s: Sequence[float] = HORIZONS_S,
    identify_controller: bool = False,
) -> FlightComparison:  # fmt: skip
    """Return the comparison of several models with one recording; arguments as in `compare`.

    A prediction horizon is left out if every uninterrupted run of rows in flight
    (`heli3dof.identification.row_selection.rows_in_flight`) is shorter.
    """
    flown = corrected(under_control(recording))
    if identify_controller and flown.profile.controller is None:
        flown = with_known_controller(flown)
    why = why_not_replayed(flown)
    in_flight = rows_in_flight(flown)

    def scored(horizon_s: float) -> np.ndarray:
        """Return (N,) bool: the rows at which predictions over ``horizon_s`` s are evaluated.

        A prediction starts ``horizon_s`` s before its row. All rows in this time must be in flight.
        """
        return rows_within(in_flight, max(1, round(horizon_s / flown.dt)))

    fits = tuple(h for h in horizons_s if scored(h).any())
    steps = STEPS_DRAWN if why else STEPS_AVERAGED  # with a replay, no prediction is drawn
    reasons: list[list[str]] = [[] for _ in models]
    replays = [
        None if why else _attempt(partial(replay, m, flown), reasons[i])
        for i, m in enumerate(models)
    ]
    made = [
        _attempt(partial(predictions, m, flown, fits, steps=steps), reasons[i]) if fits else None
        for i, m in enumerate(models)
    ]
    held = predictions(ConstantAngles(), flown, fits, steps=steps) if fits else None
    common = common_rows([p for p in (*made, held) if p is not None])
    rows = {h: ok & scored(h)[:, None] for h, ok in common.items()}
    return FlightComparison(
        recording=recording,
        flown=flown,
        experiment=metrics_in_flight(flown, flown.angle),
        loop="not replayed" if why else "replayed",
        why=why,
        constant_angles=_prediction_error(flown, held, rows, fits),
        models=tuple(
            _model_comparison(flown, m, label, r, p, rows, fits, tuple(why_not))
            for m, label, r, p, why_not in zip(
                models, labels(models), replays, made, reasons, strict=True
            )
        ),
    )


def _model_comparison(
    flown: Recording,
    model: Model,
    label: str,
    replayed: Replay | None,
    made: Predictions | None,
    rows: Mapping[float, np.ndarray],
    horizons_s: Sequence[float],
    cannot: tuple[str, ...],
) -> ModelComparison:
    metrics, rmse, trace = None, None, None
    if replayed is not None:
        metrics = metrics_in_flight(flown, replayed.angle)
        error = np.degrees(replayed.angle - flown.angle)
        # Not nanmean: a model that diverges has no RMSE.
        rmse = np.sqrt(np.mean(error**2, axis=0))
        trace = Trace("replay", replayed.t, replayed.angle)
        cannot = (*cannot, *_divergence(replayed))
    elif made is not None:
        trace = Trace("prediction", *stitched(flown, made))
    return ModelComparison(
        name=label,
        kind=model.kind,
        metrics=metrics,
        replay_rmse_deg=rmse,
        diverged_at_s=None if replayed is None else replayed.diverged_at_s,
        unstable_poles=() if replayed is None else replayed.unstable_poles,
        prediction=_prediction_error(flown, made, rows, horizons_s),
        trace=trace,
        cannot=cannot,
        other_rig=_other_rig(flown, model),
    )


def _other_rig(flown: Recording, model: Model) -> str:
    """Return a sentence if ``model`` is of another rig than the recording; else an empty text."""
    differing = differing_numbers(model.profile, flown.profile)
    return f"The model is of another rig than the recording: {differing}." if differing else ""


def _prediction_error(
    recording: Recording,
    made: Predictions | None,
    rows: Mapping[float, np.ndarray],
    horizons_s: Sequence[float],
) -> PredictionError | None:
    if made is None:
        return None
    every = rmse_deg(recording, made, rows)
    return PredictionError(
        ahead_deg={float(h): every[round(float(h), 9)] for h in horizons_s},
        over_window_deg=over_window_deg(every, made),
        window_s=made.window_s,
    )


def _divergence(replayed: Replay) -> list[str]:
    """Return one sentence in a list if the loop is unstable or the replay diverged, else []."""
    parts = []
    if replayed.unstable_poles:
        p = replayed.unstable_poles[0]
        pole = f"{p.real:+.3f}".replace("-", "−") + (
            f" ± {abs(p.imag):.3f}j" if abs(p.imag) > 1e-9 else ""
        )
        parts.append(f"unstable in this loop, with a pole at {pole} rad/s")
    if replayed.diverged_at_s is not None:
        parts.append(f"diverges at {replayed.diverged_at_s:.2f} s, so it has no metrics")
    return [f"{'; '.join(parts)}."] if parts else []


def _attempt(work: Callable[[], T], reasons: list[str]) -> T | None:
    """Return the result of ``work()``.

    If ``work()`` raises a `Heli3dofError`, append the error's text to ``reasons`` and return None.
    """
    try:
        return work()
    except Heli3dofError as error:
        if error.what not in reasons:
            reasons.append(error.what)
        return None
