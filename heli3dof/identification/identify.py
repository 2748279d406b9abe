"""`identify`: fit a model to recordings, with uncertainty, held-out scores and warnings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from heli3dof.axes import AXES, ROLL
from heli3dof.errors import RecordingError, UsageError
from heli3dof.identification.black_box.order_selection import INTERVALS_S
from heli3dof.identification.feedback import Feedback, feedback_test
from heli3dof.identification.fit_result import FitResult, Request
from heli3dof.identification.methods import Method, known_method
from heli3dof.identification.preprocessing import (
    Prepared,
    moving_axes_only,
    prepare,
    segments,
    still_axes,
)
from heli3dof.identification.residual_tests import ResidualTest, past_inputs, whiteness
from heli3dof.identification.result import SUMMARY_HORIZON_S, Identification
from heli3dof.identification.validation import WARM_UP_S, Metrics, metrics
from heli3dof.model.base import Model
from heli3dof.model.estimation.filter_data import RowRange
from heli3dof.model.linear.model import LinearModel
from heli3dof.parallel import one_blas_thread, report_progress
from heli3dof.plugins import plugin_errors
from heli3dof.recording.distinct_samples import check_distinct
from heli3dof.recording.logs.corrections import corrected
from heli3dof.recording.provenance import profile_file, run_command
from heli3dof.recording.recording import Recording
from heli3dof.recording.safety_trip import trip_warning
from heli3dof.recording.same_rig import check_same_rig
from heli3dof.stage_clock import Progress, StageClock

FEEDBACK_TEST_S = 0.02
TEST_ROWS = 60
"""Residual tests skip segments with at most this many innovations (rows) after the warm-up."""
__all__ = ["Identification", "identify"]
EXTRAPOLATION = 2.0
"""Ratio of an axis' rms motion in held-out to training data above which there is a warning"""
LITTLE_MOTION_DEG = 1.0
"""Rms motion (°) below which held-out data do not test a model. It is a few times the rms motion
that process noise alone causes within 1 s: 0.2° to 0.5° on roll and pitch of known rigs."""
ORDER_MAX = 20
OPEN_LOOP_WARNING = (
    "Output error assumes that the voltages are independent of the disturbances. In closed loop "
    "they respond to them, and because yaw integrates, simulation errors accumulate. So the "
    "parameters are biased and their standard deviations far too small. The method is here to "
    "reproduce the paper; use greybox or pem."
)


@one_blas_thread
def identify(
    recordings: Recording | Sequence[Recording],
    *,
    method: str = "greybox",
    order: int | None = None,
    terms: str | Sequence[str] | None = None,
    holdout: Recording | Sequence[Recording] | None = None,
    intervals_s: Sequence[float] = INTERVALS_S,
    name: str | None = None,
    progress: Progress = lambda sentence: None,
) -> Identification:
    """Return a model identified from recordings of one rig.

    Args:
        recordings: one or several with the same sample interval; all are fitted together. Black-box
            methods need all three angles. If one recording has all three, ``greybox`` also uses
            those that lack an angle; ``freeflight`` leaves them out, with a warning.
        method: a name from `heli3dof.identification.methods`: ``greybox`` and ``freeflight``
            (physical parameters), or a black box: ``pem``, ``pbsid``, ``oe``, ``tf4``.
        order: number of states of a black box; None starts an order search
            (`heli3dof.identification.black_box.order_selection`).
        terms: names of the effects of a physical model, such as ``motor.lag`` or
            ``friction.viscous.yaw``; None takes the method's default. As with ``--terms``, names
            with ``+`` and ``-`` change the default instead: ``["+drag.quadratic.yaw"]``.
        holdout: recordings to validate on. None sets aside the last quarter of each recording.
        intervals_s: sampling intervals (s) that the order search tries, each rounded to a multiple
            of the control period.
        name: name of the model; None takes the method's name.
        progress: receives progress messages.

    Raises:
        UsageError: an unknown method, an impossible order, samples that are given twice, or
            recordings of different rigs.
        RecordingError: recordings that cannot be used for a fit; names the recording and why.
    """
    about = known_method(method)
    if order is not None and not 1 <= order <= ORDER_MAX:
        raise UsageError(
            f"order {order} is not possible: a model has 1 to {ORDER_MAX} states.",
            cause="the rig itself has eight: six of its body, two of its rotors.",
            fix="leave order out to have it chosen",
        )
    if order is not None and about.physical:
        raise UsageError(
            f"order does not apply to {method}: its states are the rig's.",
            cause="it belongs to the black-box methods.",
            fix="method='pem', or leave order out",
        )
    if terms is not None and not about.physical:
        raise UsageError(
            f"{method} has no physical terms to choose from.",
            cause="they belong to the grey box.",
            fix="method='greybox', or leave terms out",
        )
    chosen = None
    if terms is not None:
        from heli3dof.identification.greybox.method import chosen_terms  # imports numba

        chosen = chosen_terms(terms)
    train, test = _several(recordings), _several(holdout)
    check_same_rig([*train, *test])
    check_distinct(train, test)
    clock = StageClock(progress)
    clock.start("preparation", "Selecting the rows to fit …")
    whole, partial = _by_angles(train, split=about.physical)
    prepared = prepare(whole, held_out=test)
    near = segments(prepared, prepared.train, max(1, round(FEEDBACK_TEST_S / prepared.dt)))
    feedback = feedback_test(near)
    request = Request(
        method,
        order,
        tuple(intervals_s),
        name or method,
        chosen,
        tuple(partial),
    )
    still = still_axes([*whole, *partial])
    if still and not about.physical:
        raise RecordingError(
            f"{_never_change(still)}, but a black box needs three angles that move.",
            cause="the axis is clamped, or its encoder is not connected.",
            fix="method='greybox', or a recording in which all axes move",
        )
    with plugin_errors(UsageError, f"The method {method}", about.function):
        return _fitted(about, request, prepared, still, feedback, clock)


def _fitted(
    about: Method,
    request: Request,
    prepared: Prepared,
    still: Sequence[str],
    feedback: Feedback,
    clock: StageClock,
) -> Identification:
    """Fit a model and evaluate it; ``still``: the axes that do not move in the recordings."""
    clock.start("fit", "Fitting the model …")
    with report_progress(clock.counts):
        found = without_axes(about.fit(prepared, request), still)
    method = found.method or request.method
    prepared = replace(prepared, recordings=tuple(map(moving_axes_only, prepared.recordings)))
    warnings = [*recording_warnings(prepared), *extrapolation_warnings(prepared), *found.warnings]
    if about.assumes_open_loop and feedback.present:
        warnings.append(OPEN_LOOP_WARNING)
    model = _with_provenance(found, method, prepared)
    clock.start("validation", "Evaluating the model on held-out data …")
    scores = metrics(model, prepared, prepared.held_out)
    warnings += poor_prediction_warnings(scores, prepared)
    return Identification(
        method=method,
        model=model,
        found=found,
        metrics=scores,
        residuals=residual_tests(found, prepared),
        feedback=feedback,
        prepared=prepared,
        warnings=tuple(warnings),
    )


def without_axes(found: FitResult, still: Sequence[str]) -> FitResult:
    """Return the fit without the results for the axes ``still``, which did not move.

    The returned fit omits the parameters and transfer functions of these axes. The model has the
    profile's values for them. A warning states this.
    """
    if not still:
        return found
    fixed = [f"J_{a}" for a in still] + ["T_g"] * (AXES[ROLL] in still)
    kept = [n for n in found.parameters if n not in fixed]
    rows = [list(found.parameters).index(n) for n in kept]
    transfer, R = found.transfer, found.correlation
    verdicts = {found.parameters[n].verdict for n in found.parameters if n in fixed}
    return replace(
        found,
        parameters={n: found.parameters[n] for n in kept},
        correlation=None if R is None else R[np.ix_(rows, rows)],
        transfer=None if transfer is None else replace(transfer, still=tuple(still)),
        warnings=(
            f"{_never_change(still)}: {', '.join(fixed)} {'is' if len(fixed) == 1 else 'are'} "
            "fixed at the profile's values.",
            *(w for w in found.warnings if w not in verdicts),
        ),
    )


def _never_change(still: Sequence[str]) -> str:
    return f"{' and '.join(still)} never change{'s' * (len(still) == 1)} in these recordings"


def residual_tests(found: FitResult, prepared: Prepared) -> tuple[ResidualTest, ...]:
    """Return two residual tests on held-out data: for whiteness, and independence of past voltages.

    The result is () if the data are too short.
    """
    settle = round(WARM_UP_S / (found.test_interval_s or found.interval_s))
    E, U = [], []
    for e, u in zip(*found.innovations(prepared, prepared.held_out), strict=True):
        if len(e) > settle + TEST_ROWS:
            E.append(e[settle:])
            U.append(u[settle:])
    if not E:
        return ()
    moving = np.all([np.isfinite(e).any(axis=0) for e in E], axis=0)
    E = [e[:, moving] for e in E]
    return whiteness(E), past_inputs(E, U)


def recording_warnings(prepared: Prepared) -> list[str]:
    """Return warnings of trips, a wrong log rate, jitter, lost samples, voltages at their limit."""
    out = [w for r in prepared.recordings for w in trip_warning(r)]
    for r in prepared.reports:
        c = r.timing
        if abs(c.period_s / r.control_period_s - 1) > 0.01:
            out.append(
                f"{r.name} was logged every {c.period_s * 1e3:.4g} ms, its loop ran every "
                f"{r.control_period_s * 1e3:.4g} ms: voltages between samples are unknown, which "
                "biases the rotor lag most. Log at the control rate."
            )
        if c.jitter_s > 0.05 * c.period_s:
            out.append(
                f"{r.name}: the intervals between samples scatter by {c.jitter_s * 1e3:.2g} ms RMS "
                f"({100 * c.jitter_s / c.period_s:.0f} % of the period), which adds noise to "
                "every rate."
            )
        if c.lost_share > 0.01:
            out.append(f"{r.name}: {100 * c.lost_share:.1f} % of the samples are missing.")
        if r.clipped_share > 0.05:
            out.append(
                f"{r.name}: {100 * r.clipped_share:.0f} % of the rows are at the amplifier's "
                "limit, where the loop is open."
            )
    return out


def extrapolation_warnings(prepared: Prepared) -> list[str]:
    """Return a warning for each axis that moves much more in held-out than in training data.

    That is, the ratio of the rms motions exceeds `EXTRAPOLATION`.
    """
    if not prepared.held_out:
        return []
    fitted, tested = (rms_motion_deg(prepared, x) for x in (prepared.train, prepared.held_out))
    return [
        f"{axis}: the held-out data move it by {b:.1f}° rms, the training data by {a:.1f}° only, "
        "so the held-out scores are an extrapolation. Fit a recording that moves it as far."
        for axis, a, b in zip(AXES, fitted, tested, strict=True)
        if b > EXTRAPOLATION * a
    ]


def rms_motion_deg(prepared: Prepared, runs: Sequence[RowRange]) -> np.ndarray:
    """Return the rms motion (3,) in degrees in ``runs``: the deviations from each run's mean."""
    parts = [prepared.recordings[r.source].angle[r.start : r.stop] for r in runs]
    return np.asarray(np.rad2deg(np.vstack([p - p.mean(axis=0) for p in parts]).std(axis=0)))


def poor_prediction_warnings(scores: Metrics, prepared: Prepared) -> list[str]:
    """Return warnings that name the axes with a negative fit on held-out data.

    The fit is negative if predictions `SUMMARY_HORIZON_S` s ahead are worse than the mean of the
    measured angle. Axes that move less than `LITTLE_MOTION_DEG` get a different warning, because
    their fit does not test the model.
    """
    score = scores.prediction.get(SUMMARY_HORIZON_S)
    if score is None or not prepared.held_out:
        return []
    motion = rms_motion_deg(prepared, prepared.held_out)
    each_axis = list(zip(AXES, score.fit_percent, motion, strict=True))
    little = [(a, m) for a, fit, m in each_axis if not fit >= 0 and m < LITTLE_MOTION_DEG]
    poor = [a for a, fit, m in each_axis if fit < 0 and m >= LITTLE_MOTION_DEG]
    fly = run_command("multisine", None, profile_file(prepared.recordings))
    out = []
    if little:
        each = ", ".join(f"{axis} {m:.2g}°" for axis, m in little)
        out.append(
            f"The held-out data hardly move ({each} rms), so their fit does not test the "
            f"model. To test it, record more motion: {fly}"
        )
    if poor:
        out.append(
            f"{SUMMARY_HORIZON_S:g} s predictions of {' and '.join(poor)} are worse than the mean "
            "(negative fit): the recordings hold too little of this motion. Do not use the model "
            f"for it; record a richer experiment: {fly}"
        )
    return out


def _with_provenance(found: FitResult, method: str, prepared: Prepared) -> Model:
    model = found.model
    if not isinstance(model, LinearModel):
        return model
    extra: dict[str, Any] = {
        "method": method,
        "interval_s": found.interval_s,
        "recordings": [
            {"name": prepared.recordings[i].name, "sha256": prepared.recordings[i].digest}
            for i in sorted({r.source for r in prepared.train})
        ],
        "poles": [p.to_json() for p in found.poles],
    }
    return replace(model, extra=extra, profile=prepared.recordings[0].profile)


def _by_angles(
    recordings: Sequence[Recording], *, split: bool
) -> tuple[list[Recording], list[Recording]]:
    """Return (recordings with all three angles, the rest).

    Without ``split``, or if no recording has all three, returns (all recordings, []).
    """
    whole = [r for r in recordings if len(r.axes) == len(AXES)]
    if not split or not whole:
        return list(recordings), []
    return whole, [r for r in recordings if len(r.axes) < len(AXES)]


def _several(recordings: Recording | Sequence[Recording] | None) -> list[Recording]:
    if recordings is None:
        return []
    several = [recordings] if isinstance(recordings, Recording) else recordings
    return [corrected(r) for r in several]
