"""Score a model on held-out data: the fit in percent, and the RMSE, of predictions and of a replay.

    fit = 100 (1 − ‖y − ŷ‖ / ‖y − ȳ‖)  %,     y measured, ŷ predicted, ȳ the mean of y

Each axis is scored for predictions one sample, 0.1, 0.5, 1 and 3 s ahead. It is also scored for the
closed-loop replay: a simulation in which the model follows the same references under the same
controller. One sample ahead, almost every model fits a smooth motion to nearly 100 %. Horizons of
0.5 s and more, and the replay, separate good models from bad ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.identification.preprocessing import Prepared
from heli3dof.model.base import Model
from heli3dof.model.control.loop_task import control_instants, loop_task, why_not_replayed
from heli3dof.model.estimation.filter_data import LOST, RowRange
from heli3dof.model.linear.model import LinearModel

HORIZONS_S = (0.1, 0.5, 1.0, 3.0)
WARM_UP_S = 2.0
"""s: at the start of a run (range of usable rows), the filter settles for this time. Predictions in
this time have no score. If there are usable rows directly before the run, the filter starts in
these, and the time is shorter by their length."""
LEAD_IN_S = 10.0
"""s: longest time before a run (range of usable rows) in which the filter may settle"""
AFTER_TAKE_OFF_S = 2.0
"""s: time after the first usable row of a flight from the table, without a replay score. A linear
model does not describe the rise from −27.5° of roll, and its error must decay first."""
DIVERGED_RAD = 10.0
"""rad: RMSE from which a replay counts as diverged, more than any angle of a rig. Chosen."""


@dataclass(frozen=True, eq=False)
class Score:
    """The fit (%) and RMSE (rad) of each axis, (3,), over ``rows`` rows; NaN: undefined."""

    fit_percent: np.ndarray
    rmse: np.ndarray
    rows: int


NO_SCORE = Score(np.full(3, np.nan), np.full(3, np.nan), 0)


@dataclass(frozen=True, eq=False)
class Metrics:
    """Scores of a model on held-out data: for predictions, and for a closed-loop simulation.

    ``prediction`` is {horizon in s: score}; the horizon 0.0 means one sample ahead. ``replay`` is
    the score of the simulation, in which the model follows the recorded references under the same
    controller.
    """

    prediction: dict[float, Score]
    replay: Score
    no_replay: str
    """Why there is no replay; empty if there is one"""

    @property
    def replay_note(self) -> str:
        """Return a note on the replay, which is the closed-loop simulation with the model.

        The note states why there is no replay, or that the replay diverges; otherwise it is empty.
        """
        if self.no_replay or (self.replay.rmse < DIVERGED_RAD).all():
            return self.no_replay
        return "the loop with this model diverges"

    def to_json(self) -> dict[str, Any]:
        """Return ``fit_percent`` and ``rmse_deg`` by axis, and the `replay_note`.

        Each axis has the keys ``one_step``, ``0.1_s``, …, ``closed_loop_replay``. Unavailable
        scores are NaN.
        """
        named = {("one_step" if h == 0 else f"{h:g}_s"): s for h, s in self.prediction.items()}
        named["closed_loop_replay"] = self.replay

        def by_axis(values: Mapping[str, np.ndarray]) -> dict[str, dict[str, float]]:
            return {a: {n: float(v[i]) for n, v in values.items()} for i, a in enumerate(AXES)}

        return {
            "fit_percent": by_axis({name: s.fit_percent for name, s in named.items()}),
            "rmse_deg": by_axis({name: np.rad2deg(s.rmse) for name, s in named.items()}),
            "replay_note": self.replay_note,
        }


def score(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> Score:
    """Return the fit (%) and RMSE over all pairs of measured and predicted angles (N, 3) rad.

    A row is skipped if a measured or predicted angle in it is NaN. This rule ignores an axis that
    was not measured (NaN in every row); the score of such an axis is NaN. The equation of the fit
    is in the module's docstring. Its ȳ is the mean measured angle of an axis, computed for each
    pair separately. The fit is NaN for an axis whose measured angle is constant.
    """
    error, spread, rows = np.zeros(3), np.zeros(3), 0
    for y, predicted in pairs:
        measured = np.isfinite(y).any(axis=0)
        ok = (np.isfinite(y) & ~np.isnan(predicted))[:, measured].all(axis=1)
        if not ok.any():
            continue
        error += ((y - predicted)[ok] ** 2).sum(axis=0)
        moves = np.ptp(y[ok], axis=0) > 0  # the mean of equal numbers is rounded
        spread += np.where(moves, ((y[ok] - y[ok].mean(axis=0)) ** 2).sum(axis=0), 0.0)
        rows += int(ok.sum())
    if rows == 0:
        return NO_SCORE
    with np.errstate(divide="ignore", invalid="ignore"):
        fit = np.where(spread > 0, 100 * (1 - np.sqrt(error / spread)), np.nan)
    return Score(fit, np.sqrt(error / rows), rows)


def predictions(
    model: Model, prepared: Prepared, runs: Sequence[RowRange], horizon_s: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return measured and predicted angles (N, 3) rad for each run of usable rows.

    ``runs`` are ranges of usable rows of the recordings in ``prepared``. The predictions are
    ``horizon_s`` (s) ahead; 0: one sample. They are NaN until the filter has settled.
    """
    out = []
    for run in runs:
        recording = prepared.recordings[run.source]
        lead = _lead_in(prepared, run, round(LEAD_IN_S / prepared.dt))
        part = recording.rows(slice(run.start - lead, run.stop))
        predicted = model.predict(part, horizon_s or part.dt)[lead:].copy()
        settle = round((WARM_UP_S + horizon_s) / prepared.dt) - lead
        if settle > 0:
            predicted[:settle] = np.nan
        out.append((recording.angle[run.start : run.stop], predicted))
    return out


def _lead_in(prepared: Prepared, run: RowRange, most: int) -> int:
    """Return the number of rows (at most ``most``) before ``run`` in which the filter can settle.

    These rows belong to another run, which ends directly before ``run``, without a gap.
    """
    for other in (*prepared.train, *prepared.held_out):
        if other.source == run.source and other.stop == run.start:
            t = prepared.recordings[run.source].t
            if t[run.start] - t[run.start - 1] > LOST * prepared.dt:
                return 0
            return min(most, other.stop - other.start)
    return 0


def replay_obstacle(prepared: Prepared, sources: Sequence[int], model: Model) -> str:
    """Return why ``model`` cannot replay the recordings with indices ``sources``, or ``""``.

    The replay is a closed-loop simulation with the period of the controller. The log's sample
    interval may differ from this period. A linear model is valid for one sample interval only. So
    it cannot replay a recording whose controller has another period.
    """
    for i in sources:
        r = prepared.recordings[i]
        if reason := why_not_replayed(r):
            return f"not available: {r.name}: {reason}"
        if prepared.reports[i].long_gaps:
            return f"not available: {r.name} has long gaps, so references are missing"
        if isinstance(model, LinearModel) and abs(model.dt / r.profile.dt - 1) > 0.01:
            return (
                f"not available: the model is for samples every {model.dt * 1e3:.4g} ms, as "
                f"logged; the control period of {r.name} is {r.profile.dt * 1e3:.4g} ms"
            )
    return ""


def replays(
    model: Model, prepared: Prepared, runs: Sequence[RowRange]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return measured and replayed angles (N, 3) rad for each recording that has ``runs``.

    The replay is a closed-loop simulation of ``model`` with the recorded references and controller.
    Only the rows of ``runs`` (row ranges) are returned. If the rig was on its table during a
    recording, its rows up to `AFTER_TAKE_OFF_S` s after the first usable row are left out.
    """
    out = []
    settle = round(AFTER_TAKE_OFF_S / prepared.dt)
    for source in sorted({r.source for r in runs}):
        recording = prepared.recordings[source]
        task = loop_task(recording)
        with np.errstate(over="ignore", invalid="ignore"):
            flown = model.fly(task).angle
        grid = control_instants(recording.t, task.dt)
        angle = np.column_stack([np.interp(recording.t, grid, a) for a in flown.T])
        # A simulation that diverges gets a huge error, not missing rows.
        angle = np.where(np.isfinite(angle) & (np.abs(angle) < 1e6), angle, 1e6)
        mine = np.zeros(len(recording), dtype=bool)
        for r in runs:
            if r.source == source:
                mine[r.start : r.stop] = True
        if prepared.reports[source].left_out["table"] > 0:
            usable = (*prepared.train, *prepared.held_out)
            mine[: min(r.start for r in usable if r.source == source) + settle] = False
        out.append((recording.angle[mine], angle[mine]))
    return out


def metrics(model: Model, prepared: Prepared, runs: Sequence[RowRange]) -> Metrics:
    """Return all scores of a model over row ranges ``runs``, usually ``prepared.held_out``."""
    prediction = {h: score(predictions(model, prepared, runs, h)) for h in (0.0, *HORIZONS_S)}
    no_replay = replay_obstacle(prepared, sorted({r.source for r in runs}), model)
    replay = NO_SCORE if no_replay else score(replays(model, prepared, runs))
    return Metrics(prediction, replay, no_replay)
