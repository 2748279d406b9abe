"""`identify`: recordings in, a model with its uncertainty and its faults out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.errors import UsageError
from heli3dof.identification import methods
from heli3dof.identification.black_box.order_selection import INTERVALS_S
from heli3dof.identification.blas_threads import one_thread
from heli3dof.identification.feedback import feedback_test
from heli3dof.identification.fit_result import Found, Request
from heli3dof.identification.preprocessing import Prepared, Run, prepare, segments
from heli3dof.identification.residual_tests import ResidualTest, past_inputs, whiteness
from heli3dof.identification.result import Identification, pole_json
from heli3dof.identification.validation import WARM_UP_S, Metrics, metrics
from heli3dof.model.base import Model
from heli3dof.model.linear.model import LinearModel
from heli3dof.recording.recording import Recording

FEEDBACK_TEST_S = 0.02
TEST_ROWS = 60
"""A segment shorter than this, at the interval of the fit, is not tested for whiteness."""
__all__ = ["Identification", "identify"]
USEFUL_S = 0.5
"""s; a model that cannot tell this far ahead is of no use in a loop."""
BEYOND = 2.0
"""Held-out motion larger than that fitted by this factor is worth a warning."""


@one_thread
def identify(
    recordings: Recording | Sequence[Recording],
    *,
    method: str = "greybox",
    order: int | None = None,
    terms: Sequence[str] | None = None,
    holdout: Recording | Sequence[Recording] | None = None,
    intervals_s: Sequence[float] = INTERVALS_S,
    name: str | None = None,
) -> Identification:
    """Identify a model from recordings of one rig.

    Args:
        recordings: one or several of the same sample interval; all are fitted together. Black
            boxes need all three angles; the grey box also uses recordings that lack some, beside
            at least one that does not.
        method: ``greybox`` (physical parameters), or a black box: ``pem``, ``pbsid``, ``tf4`` (the
            paper's form), ``oe``.
        order: number of states of a black box; None chooses
        (`heli3dof.identification.black_box.order_selection`). terms: effects of the grey box, by
        name, as ``motor.lag`` or ``friction.viscous.yaw``; None
            takes those that every rig has (`heli3dof.identification.greybox.method`).
        holdout: recordings to validate on. None sets aside the last quarter of each recording.
        intervals_s: sampling intervals (s) to try; each becomes a multiple of the control period.
        name: of the model; None names it after the method.

    Returns:
        An `Identification`: the model, poles and transfer functions with standard deviations,
        metrics on held-out data only, residual tests, and what to be warned of.

    Raises:
        UsageError: an unknown method or an impossible order.
        RecordingError: recordings that cannot carry a fit; says which and why.
    """
    about = methods.known_method(method)
    if order is not None and not 1 <= order <= 20:
        raise UsageError(
            f"--order {order} cannot be: a model has 1 to 20 states.",
            cause="the rig itself has eight: six of its body, two of its rotors.",
            fix="leave --order out to have it chosen",
        )
    if order is not None and about.physical:
        raise UsageError(
            f"--order {order} says nothing to {method}: its states are the rig's.",
            cause="the option belongs to the black-box methods.",
            fix="--method pem --order …, or leave --order out",
        )
    if terms is not None and not about.physical:
        raise UsageError(
            f"{method} has no physical terms to choose from.",
            cause="the option belongs to the grey box.",
            fix="--method greybox --terms …, or leave --terms out",
        )
    whole, partial = _by_angles(_several(recordings), apart=about.physical)
    prepared = prepare(whole, held_out=_several(holdout))
    near = segments(prepared, prepared.train, max(1, round(FEEDBACK_TEST_S / prepared.dt)))
    feedback = feedback_test([(s.u, s.y) for s in near])
    request = Request(
        method,
        order,
        tuple(intervals_s),
        name or method,
        None if terms is None else tuple(terms),
        tuple(partial),
    )
    found = methods.fit(prepared, request)
    method = found.method or method
    said = [*recording_warnings(prepared), *extrapolation_warnings(prepared), *found.warnings]
    if about.assumes_open_loop and feedback.present:
        said.append(methods.OPEN_LOOP_WARNING)
    model = _with_provenance(found, method, prepared)
    scores = metrics(model, prepared, prepared.held_out)
    said += useless_warnings(scores, prepared)
    return Identification(
        method=method,
        model=model,
        found=found,
        metrics=scores,
        residuals=residual_tests(found, prepared),
        feedback=feedback,
        prepared=prepared,
        warnings=tuple(said),
    )


def residual_tests(found: Found, prepared: Prepared) -> tuple[ResidualTest, ...]:
    """Whiteness and past inputs on held-out data; empty where there is too little of it."""
    settle = round(WARM_UP_S / (found.test_interval_s or found.interval_s))
    E, U = [], []
    for e, u in zip(*found.innovations(prepared, prepared.held_out), strict=True):
        if len(e) > settle + TEST_ROWS:
            E.append(e[settle:])
            U.append(u[settle:])
    return (whiteness(E), past_inputs(E, U)) if E else ()


def recording_warnings(prepared: Prepared) -> list[str]:
    """Faults of clocks and voltages that bias a fit."""
    out = []
    for r in prepared.reports:
        c = r.clock
        if abs(c.period_s / c.nominal_s - 1) > 0.01:
            out.append(
                f"{r.name} was logged every {c.period_s * 1e3:.4g} ms, its loop ran every "
                f"{c.nominal_s * 1e3:.4g} ms: voltages between samples are unknown, which biases "
                "the rotor lag most. Log at the control rate."
            )
        if c.jitter_s > 0.05 * c.period_s:
            out.append(
                f"{r.name}: samples come {c.jitter_s * 1e3:.2g} ms early or late "
                f"({100 * c.jitter_s / c.period_s:.0f} % of the period), which blurs every rate."
            )
        if c.lost_share > 0.01:
            out.append(f"{r.name}: {100 * c.lost_share:.1f} % of the samples are missing.")
        if r.clipped_share > 0.05:
            out.append(
                f"{r.name}: {100 * r.clipped_share:.0f} % of the rows fly at the amplifier's "
                "limit, where the loop is open for a while."
            )
    return out


def extrapolation_warnings(prepared: Prepared) -> list[str]:
    """Axes that the held-out data move much further than the data that were fitted."""

    def spread(runs: Sequence[Run]) -> np.ndarray:
        parts = [prepared.recordings[r.source].angle[r.start : r.stop] for r in runs]
        return np.asarray(np.vstack([p - p.mean(axis=0) for p in parts]).std(axis=0))

    if not prepared.held_out:
        return []
    fitted, tested = np.rad2deg(spread(prepared.train)), np.rad2deg(spread(prepared.held_out))
    return [
        f"{axis}: the held-out data move it by {b:.1f}° rms, the data fitted by {a:.1f}° only, so "
        "the figures on held-out data are an extrapolation. Fit a recording that moves it as far."
        for axis, a, b in zip(AXES, fitted, tested, strict=True)
        if b > BEYOND * a
    ]


def useless_warnings(scores: Metrics, prepared: Prepared) -> list[str]:
    """Axes on which the model tells less than their mean does, although they were moved."""
    score = scores.prediction.get(USEFUL_S)
    if score is None or not prepared.held_out:
        return []
    bad = [a for a, fit in zip(AXES, score.fit_percent, strict=True) if fit < 0]
    if not bad:
        return []
    return [
        f"{USEFUL_S:g} s ahead the model tells less than the mean does of {' and '.join(bad)}: the "
        "recordings hardly move what they are fitted to or judged on. Do not use it there; fly "
        "something richer: heli3dof run multisine"
    ]


def _with_provenance(found: Found, method: str, prepared: Prepared) -> Model:
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
        "poles": [pole_json(p) for p in found.poles],
    }
    return replace(model, extra=extra)


def _by_angles(
    recordings: Sequence[Recording], *, apart: bool
) -> tuple[list[Recording], list[Recording]]:
    """Recordings with all three angles, and the others where a method can use those."""
    whole = [r for r in recordings if len(r.axes) == len(AXES)]
    if not apart or not whole:
        return list(recordings), []
    return whole, [r for r in recordings if len(r.axes) < len(AXES)]


def _several(recordings: Recording | Sequence[Recording] | None) -> list[Recording]:
    if recordings is None:
        return []
    return [recordings] if isinstance(recordings, Recording) else list(recordings)
