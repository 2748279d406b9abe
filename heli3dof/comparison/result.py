"""The result classes of `compare`: of the whole comparison, of each recording, of each model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from heli3dof.arrays import FloatArray
from heli3dof.axes import AXES
from heli3dof.comparison.document import comparison_document
from heli3dof.comparison.metrics import METRICS, AxisMetrics
from heli3dof.comparison.prediction import CONSTANT_ANGLES
from heli3dof.comparison.verdict import verdict
from heli3dof.recording.recording import Recording
from heli3dof.recording.safety_trip import trip_warning
from heli3dof.results import Result, optional

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, eq=False)
class Trace:
    """A model's curve for a figure: times t (M,) s, angle (M, 3) rad; NaN interrupts the curve."""

    kind: str
    """``replay`` (closed-loop simulation) or ``prediction`` (multi-step, in successive windows)"""
    t: FloatArray
    angle: FloatArray


@dataclass(frozen=True, eq=False)
class PredictionError:
    """Prediction RMSE (3,) in degrees at each horizon, and over all horizons to ``window_s`` s."""

    ahead_deg: Mapping[float, FloatArray]
    over_window_deg: FloatArray
    window_s: float


@dataclass(frozen=True, eq=False)
class ModelComparison:
    """One model compared with one recording: step metrics and errors of replay and prediction."""

    name: str
    """The model's label (`heli3dof.model.labels`), distinct among the compared models"""
    kind: str
    metrics: Mapping[str, AxisMetrics] | None
    """Step metrics by axis of the closed-loop replay; None if there is no replay"""
    replay_rmse_deg: FloatArray | None
    """(3,) RMSE between replayed and measured angles, degrees; NaN if the model diverges"""
    diverged_at_s: float | None
    unstable_poles: tuple[complex, ...]
    prediction: PredictionError | None
    trace: Trace | None
    cannot: tuple[str, ...]
    """Sentences: what could not be computed with this model, and why"""
    other_rig: str = ""
    """A sentence, if the model is of another rig than the recording; else empty"""


@dataclass(frozen=True, eq=False)
class FlightComparison:
    """One recording compared with every model. ``experiment`` holds the measured step metrics."""

    recording: Recording
    """The complete recording, as loaded"""
    flown: Recording
    """The part of the recording under closed-loop control, which the other attributes describe"""
    experiment: Mapping[str, AxisMetrics]
    loop: str
    """Whether the closed loop was simulated: ``replayed`` or ``not replayed``"""
    why: str | None
    """Why the closed loop was not simulated; None if it was"""
    constant_angles: PredictionError | None
    models: tuple[ModelComparison, ...]

    @property
    def predictions(self) -> dict[str, PredictionError | None]:
        """Return model → its prediction errors; the baseline `CONSTANT_ANGLES` is the last."""
        models = {m.name: m.prediction for m in self.models}
        return {**models, CONSTANT_ANGLES: self.constant_angles}

    def difference(self, model: ModelComparison, axis: str) -> dict[str, float]:
        """Return the model's six step metrics on ``axis``, minus those of the measured angle.

        A difference is NaN if the metric is undefined for the model or for the measured angle.
        """
        if model.metrics is None:
            return dict.fromkeys(METRICS, np.nan)
        ours = model.metrics[axis].reported.values()
        theirs = self.experiment[axis].reported.values()
        return {name: ours[name] - theirs[name] for name in METRICS}

    def model(self, name: str) -> ModelComparison:
        """Return the comparison of the model labelled ``name``; raise KeyError if there is none."""
        for m in self.models:
            if m.name == name:
                return m
        raise KeyError(name)


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Result):
    """The result of `heli3dof.compare`: every model compared with every recording."""

    flights: tuple[FlightComparison, ...]
    horizons_s: tuple[float, ...]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return sentences on safety trips, models of another rig, and results that are missing.

        Missing results are simulations and predictions that could not be computed.
        """
        sentences = []
        for f in self.flights:
            sentences += trip_warning(f.recording)
            if f.why is not None:
                sentences.append(f"{f.recording.name}: not replayed: {f.why}.")
            if self.horizons_s and f.constant_angles is None:
                sentences.append(
                    f"{f.recording.name}: not predicted: no {min(self.horizons_s):g} s without "
                    "take-off, table and stops."
                )
            for m in f.models:
                each = [*m.cannot, *([m.other_rig] if m.other_rig else [])]
                sentences += [f"{f.recording.name}, {m.name}: {c}" for c in each]
        return tuple(sentences)

    def summary(self) -> str:
        """Return a short text: each model's RMSE by recording, the verdict and the warnings."""
        models = dict.fromkeys(m.name for f in self.flights for m in f.models)
        lines = [
            f"Comparison of {', '.join(models) or 'no model'} with {len(self.flights)} "
            f"recording{'s' * (len(self.flights) != 1)}; RMSE of roll, pitch, yaw:"
        ]
        for f in self.flights:
            each = "; ".join(f"{m.name} {_rmse(f, m)}" for m in f.models)
            how = "closed-loop replay" if f.why is None else _window(f)
            lines.append(f"  {f.recording.name}, {how}: {each}")
        return "\n".join([*lines, *verdict(self), *(f"  Warning: {w}" for w in self.warnings)])

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison as ``compare --json`` prints it, without the paper's numbers."""
        return comparison_document(self)

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a pandas data frame with a row per recording, model and axis.

        Rows with ``experiment`` in place of a model's name contain the measured metrics. Columns:
        the six metrics, ``replay_rmse_deg``, and ``rmse_deg_H_s`` of predictions H s ahead. Raises
        UsageError if pandas is missing.
        """
        rows = [row for f in self.flights for row in _rows(f)]
        return optional("pandas").DataFrame(rows).set_index(["recording", "model", "axis"])


def _window(flight: FlightComparison) -> str:
    held = flight.constant_angles
    return "not predicted" if held is None else f"predictions 0 to {held.window_s:g} s ahead"


def _rmse(flight: FlightComparison, m: ModelComparison) -> str:
    """Return a model's RMSE of each axis as text; a dash where it is unknown."""
    values = m.replay_rmse_deg
    if flight.why is not None:
        values = None if m.prediction is None else m.prediction.over_window_deg
    return "–" if values is None else ", ".join("–" if np.isnan(v) else f"{v:.2f}°" for v in values)


def _rows(flight: FlightComparison) -> list[dict[str, Any]]:
    rows = []
    for i, axis in enumerate(AXES):
        key = {"recording": flight.recording.name, "model": "experiment", "axis": axis}
        rows.append({**key, **flight.experiment[axis].reported.values()})
        for m in flight.models:
            row: dict[str, Any] = {**key, "model": m.name}
            if m.metrics is not None:
                row |= m.metrics[axis].reported.values()
            if m.replay_rmse_deg is not None:
                row["replay_rmse_deg"] = float(m.replay_rmse_deg[i])
            if m.prediction is not None:
                ahead = m.prediction.ahead_deg.items()
                row |= {f"rmse_deg_{h:g}_s": float(v[i]) for h, v in ahead}
            rows.append(row)
    return rows
