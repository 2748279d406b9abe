"""`compare`: recordings and models side by side, as Table II and Figures 7–9 do.

Where a recording's loop is known every model flies the same task (`heli3dof.comparison.replay`) and
its step metrics stand beside the experiment's, with their differences (what Table II really
holds, E11). Where it is unknown the models are judged by free prediction only
(`heli3dof.comparison.prediction`), which is given for every recording.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from heli3dof.comparison.metrics import METRICS, AxisMetrics, flight_metrics
from heli3dof.comparison.prediction import (
    HORIZONS_S,
    STEPS_AVERAGED,
    STEPS_DRAWN,
    HeldStill,
    Predictions,
    common_rows,
    over_window_deg,
    predictions,
    rmse_deg,
    stitched,
)
from heli3dof.comparison.replay import Replay, replay, under_control, why_not_replayed
from heli3dof.errors import Heli3dofError
from heli3dof.model.base import Model
from heli3dof.recording.recording import Recording

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Trace:
    """A curve for a figure: t (M,) s, angle (M, 3) rad; NaN breaks the line."""

    label: str
    kind: str
    """``replay`` of the closed loop, or ``prediction`` in stitched windows."""
    t: np.ndarray
    angle: np.ndarray


@dataclass(frozen=True, eq=False)
class PredictionError:
    """RMSE in degrees (3,) by horizon in s, and over the whole of the longest one."""

    ahead_deg: Mapping[float, np.ndarray]
    over_window_deg: np.ndarray
    window_s: float


@dataclass(frozen=True, eq=False)
class ModelComparison:
    """One model against one recording."""

    name: str
    kind: str
    metrics: Mapping[str, AxisMetrics] | None
    """Per axis, of the replay; None where the loop is not replayed."""
    replay_rmse_deg: np.ndarray | None
    """(3,) degrees between replay and experiment; NaN where the model diverges."""
    diverged_at_s: float | None
    unstable_poles: tuple[complex, ...]
    prediction: PredictionError | None
    trace: Trace | None
    cannot: tuple[str, ...]
    """What could not be done with this model here, and why."""


@dataclass(frozen=True, eq=False)
class FlightComparison:
    """One recording and every model against it."""

    recording: Recording
    """As it was given."""
    flown: Recording
    """The part that a controller flew: what everything below is about."""
    experiment: Mapping[str, AxisMetrics]
    loop: str
    """``replayed`` or ``not replayed``."""
    why: str | None
    """Why the loop was not replayed."""
    held_still: PredictionError | None
    models: tuple[ModelComparison, ...]

    def difference(self, model: ModelComparison, axis: str) -> dict[str, float]:
        """The model's six metrics minus the experiment's; NaN where either is undefined."""
        if model.metrics is None:
            return dict.fromkeys(METRICS, np.nan)
        ours = model.metrics[axis].reported.values()
        theirs = self.experiment[axis].reported.values()
        return {name: ours[name] - theirs[name] for name in METRICS}

    def model(self, name: str) -> ModelComparison:
        """The comparison of the model with this name. Raises KeyError."""
        for m in self.models:
            if m.name == name:
                return m
        raise KeyError(name)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Everything that `compare` found; see ``heli3dof.comparison.document`` for its JSON."""

    flights: tuple[FlightComparison, ...]
    horizons_s: tuple[float, ...]

    @property
    def warnings(self) -> tuple[str, ...]:
        """One sentence for everything that could not be done or that diverged."""
        found = []
        for f in self.flights:
            if f.why is not None:
                found.append(f"{f.recording.name}: not replayed, for {f.why}.")
            for m in f.models:
                found += [f"{f.recording.name}, {m.name}: {c}" for c in m.cannot]
        return tuple(found)


Models = Sequence[Model] | Callable[[Recording], Sequence[Model]]


def compare(
    recordings: Sequence[Recording], models: Models, *, horizons_s: Sequence[float] = HORIZONS_S
) -> Comparison:
    """Compare every model with every recording.

    ``models`` may be a function of the recording, for models that are made from its profile.
    ``horizons_s`` are those of the free prediction; none are predicted when it is empty. Nothing
    that one model cannot do stops the others: its reason stands under ``cannot``.
    """
    flights = tuple(
        compare_flight(r, models(r) if callable(models) else models, horizons_s=horizons_s)
        for r in recordings
    )
    return Comparison(flights, tuple(float(h) for h in horizons_s))


def compare_flight(
    recording: Recording, models: Sequence[Model], *, horizons_s: Sequence[float] = HORIZONS_S
) -> FlightComparison:
    """One recording against several models."""
    flown = under_control(recording)
    why = why_not_replayed(flown)
    fits = tuple(h for h in horizons_s if h < flown.duration)
    steps = STEPS_DRAWN if why else STEPS_AVERAGED  # a replay is drawn itself
    reasons: list[list[str]] = [[] for _ in models]
    replays = [
        None if why else _attempt(partial(replay, m, flown), reasons[i])
        for i, m in enumerate(models)
    ]
    made = [
        _attempt(partial(predictions, m, flown, fits, steps=steps), reasons[i]) if fits else None
        for i, m in enumerate(models)
    ]
    held = predictions(HeldStill(), flown, fits, steps=steps) if fits else None
    rows = common_rows([p for p in (*made, held) if p is not None])
    return FlightComparison(
        recording=recording,
        flown=flown,
        experiment=_metrics(flown, flown.angle),
        loop="not replayed" if why else "replayed",
        why=why,
        held_still=_prediction_error(flown, held, rows, fits),
        models=tuple(
            _model_comparison(flown, m, r, p, rows, fits, tuple(reasons[i]))
            for i, (m, r, p) in enumerate(zip(models, replays, made, strict=True))
        ),
    )


def _model_comparison(
    flown: Recording,
    model: Model,
    replayed: Replay | None,
    made: Predictions | None,
    rows: Mapping[float, np.ndarray],
    horizons_s: Sequence[float],
    cannot: tuple[str, ...],
) -> ModelComparison:
    metrics, rmse, trace = None, None, None
    if replayed is not None:
        metrics = _metrics(flown, replayed.angle)
        error = np.degrees(replayed.angle - flown.angle)
        # Not nanmean: a model that diverges has no RMSE, rather than that of its first seconds.
        rmse = np.sqrt(np.mean(error**2, axis=0))
        trace = Trace(model.name, "replay", replayed.t, replayed.angle)
        cannot = (*cannot, *_divergence(replayed))
    elif made is not None:
        trace = Trace(model.name, "prediction", *stitched(flown, made))
    return ModelComparison(
        name=model.name,
        kind=model.kind,
        metrics=metrics,
        replay_rmse_deg=rmse,
        diverged_at_s=None if replayed is None else replayed.diverged_at_s,
        unstable_poles=() if replayed is None else replayed.unstable_poles,
        prediction=_prediction_error(flown, made, rows, horizons_s),
        trace=trace,
        cannot=cannot,
    )


def _metrics(flown: Recording, angle: np.ndarray) -> Mapping[str, AxisMetrics]:
    """Metrics of the experiment or of a replay over the same rows."""
    grain = flown.profile.encoder.rad_per_count
    return flight_metrics(flown.t, angle, flown.reference, resolution=grain)


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
    """One sentence on a model that the gain does not hold."""
    said = []
    if replayed.unstable_poles:
        p = replayed.unstable_poles[0]
        pole = f"{p.real:+.3f}" + (f" ± {abs(p.imag):.3f}j" if abs(p.imag) > 1e-9 else "")
        said.append(f"unstable in this loop, with a pole at {pole} rad/s")
    if replayed.diverged_at_s is not None:
        said.append(f"diverges at {replayed.diverged_at_s:.2f} s, so it has no metrics")
    return [f"{'; '.join(said)}."] if said else []


def _attempt(work: Callable[[], T], reasons: list[str]) -> T | None:
    """The work's result, or None with the reason noted where an error of ours explains it."""
    try:
        return work()
    except Heli3dofError as error:
        if error.what not in reasons:
            reasons.append(error.what)
        return None
