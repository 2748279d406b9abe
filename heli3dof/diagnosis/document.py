"""Convert a diagnosis to its JSON document, ``heli3dof.diagnosis/1``.

Every document has all top-level keys.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from heli3dof.axes import AXES
from heli3dof.diagnosis.base_parameters import FINDINGS, BaseParameter, OffNominal
from heli3dof.diagnosis.conclusion.confounded_parameters import separable_by_flight
from heli3dof.diagnosis.conclusion.unknown_controller import is_biased
from heli3dof.diagnosis.conclusion.wrong_lengths import wrong_lengths
from heli3dof.diagnosis.planning.free_run_plan import why_none
from heli3dof.diagnosis.result import (
    Diagnosis,
    Finding,
    Fitted,
    NextExperiment,
    TorqueTerm,
    UnexplainedError,
    in_order_of_selection,
    physical,
)
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.gain import HORIZON_S, Gain
from heli3dof.identification.greybox.thrust_scale import Measured
from heli3dof.identification.profile_update import profile_keys, ratios
from heli3dof.integrity import Fault
from heli3dof.model.effects import term
from heli3dof.model.greybox.linearisation import LevelHover, level_hover


def diagnosis_document(
    d: Diagnosis, model_file: str | None = None, upcoming: NextExperiment | None = None
) -> dict[str, Any]:
    """Return the JSON document of a diagnosis; ``model_file``: path of the extended model.

    ``upcoming``: the recommended flight, from `planning.next_experiment.next_experiment`. By
    default, the document recommends the plan that the effects' catalogue names for the first
    confounded cause (`_catalogue_recommendation`). Besides the keys of
    `docs/reference/contract.md`, the document has ``integrity``, ``dropped`` (causes that were not
    adopted) and ``about`` (seed, null simulations, threshold, computing times).
    """
    f = d.fitted
    hover = None if f is None else level_hover(f.model)
    about = dict(d.about)
    following = _catalogue_recommendation(d) if upcoming is None else _recommendation(upcoming)
    if f is not None and (lengths := _wrong_lengths(f, hover)):
        about["corrected_lengths_m"] = lengths
    if upcoming is not None and upcoming.plan is None:
        about["no_next_experiment"], following = upcoming.why, None
    elif following is None and f is not None and f.final is None:
        about["no_next_experiment"] = why_none(f.open)
    return {
        "schema": "heli3dof.diagnosis/1",
        "recordings": list(d.recordings),
        "holdout": list(d.holdout),
        "verdict": d.verdict,
        "simulation_error": {a: _simulation_error(f, a) for a in AXES},
        "calibration": [] if f is None else _calibration(d, f),
        "calibration_gain": _calibration_gain(f),
        "profile": _profile(f, hover),
        "ratios": _ratios(f, hover),
        "findings": [_cause(x) for x in d.in_order],
        "not_identifiable": list(d.not_identifiable),
        "leftover": [
            *(_residual_torque(x) for x in d.residual_torques),
            *(_remainder(r) for r in d.remainders),
        ],
        "slow_noise": [
            {
                "axis": x.axis,
                "rms_Nm": x.size_Nm,
                "share": x.share,
                "table": list(map(list, x.table)),
            }
            for x in d.slow_noise
        ],
        "next_experiment": following,
        "gain": {"horizon_s": HORIZON_S, **_gain(None if f is None else f.gain, f)},
        "model": model_file,
        "integrity": [x.to_dict() for x in d.integrity],
        "dropped": [{"effect": x.name, "why": x.why, "gain": _gain(x.gain)} for x in d.dropped],
        "about": about,
    }


def _simulation_error(f: Fitted | None, axis: str) -> dict[str, Any]:
    """Return a JSON object with the prediction errors of one axis, each with its noise floor.

    A prediction is a simulation that starts from an estimated state of the recorded flight. The
    simulated model is the one that the diagnosis tries to improve: the rigid body with the
    profile's parameter values, usually without effects. The noise floor is the error that would
    remain with the true model. The object contains the RMSE at each prediction horizon, and the
    time intervals with the largest errors.
    """
    if f is None:
        return {"rmse_deg": None, "noise_floor_deg": None, "horizon_s": HORIZON_S}
    e = f.simulation_error

    def at(horizon_s: float) -> dict[str, Any]:
        error, floor = map(_finite_or_none, e.at(horizon_s, axis))
        return {"rmse_deg": error, "noise_floor_deg": floor, "horizon_s": horizon_s}

    each = (asdict(w) for w in e.worst if w.axis == axis)
    worst = [{k: v for k, v in w.items() if k != "axis"} for w in each]
    return {**at(HORIZON_S), "by_horizon": [at(h) for h in e.horizons_s], "worst": worst}


def _calibration(d: Diagnosis, f: Fitted) -> list[dict[str, Any]]:
    """Return a JSON object for each base parameter: estimate, nominal value, relative tolerance.

    The base parameters are the thrust gain, the trim torque and three inertias. The value of
    ``beyond_tolerance`` is one of these:

    - "surely": the parameter differs significantly from nominal by more than the tolerance. It is
      reported as a finding.
    - "not_surely": the estimate differs from nominal by more than the tolerance, but noise or a
      residual torque may be the reason.
    - "no": the estimate is within the tolerance.
    """
    tolerance = f.model.profile.tolerance
    findings = {x.term.name for x in d.calibration_findings}
    findings |= {x.term.name for x in d.findings}

    def beyond(c: BaseParameter) -> str:
        if FINDINGS[c.name] in findings:
            return "surely"
        return "not_surely" if c.excess(tolerance) > 0 else "no"

    return [
        {
            "parameter": c.name,
            "nominal": c.nominal,
            "value": c.value,
            "std": c.std,
            "unit": c.unit,
            "tolerance": tolerance,
            "beyond_tolerance": beyond(c),
        }
        for c in f.calibration
    ]


def _profile(f: Fitted | None, hover: LevelHover | None) -> list[dict[str, Any]]:
    """Return a JSON object for each key of the profile that `profile update` changes.

    ``was`` is the key's value in the profile, ``value`` the calibrated value.
    """
    if f is None:
        return []
    base = {c.name: c for c in f.calibration}
    keys = profile_keys(base, f.model.profile, hover)
    return [{"key": k, "was": m.nominal, "value": m.value, "std": m.std} for k, m in keys.items()]


def _ratios(f: Fitted | None, hover: LevelHover | None) -> list[dict[str, Any]]:
    """Return JSON objects: the hover voltage, and the ratio K_f/J of thrust gain to each inertia.

    A flight does not identify K_f alone. If the K_f of a fit is wrong by a factor, the inertias J
    are wrong by the same factor, so K_f/J is correct. A ratio K_f/J is omitted if the first fit
    estimated an implausible J. That fit was repeated with a narrow prior on the inertias. So this
    prior, not the recordings, would determine the ratio.
    """
    if f is None:
        return []
    biased = {f"K_f/J_{a}" for a in AXES if f.final is not None and is_biased(f.final, a)}
    return [
        {"ratio": n, "nominal": m.nominal, "value": m.value, "std": m.std}
        for n, m in _measured_ratios(f, hover).items()
        if n not in biased
    ]


def _measured_ratios(f: Fitted, hover: LevelHover | None) -> dict[str, Measured]:
    return ratios({c.name: c for c in f.calibration}, f.model.profile, hover)


def _wrong_lengths(f: Fitted, hover: LevelHover | None) -> dict[str, dict[str, float]]:
    """Return {length: its value in the profile, its probable true value} if lengths are wrong."""
    profile = f.model.profile
    return {
        name: {"profile": getattr(profile.geometry, name), "value": value}
        for name, value in wrong_lengths(profile, _measured_ratios(f, hover)).items()
    }


def _calibration_gain(f: Fitted | None) -> dict[str, Any]:
    """Return a JSON object: how much fitted inertias and trim torque reduce prediction errors.

    The object compares two simulations without the causes found by the diagnosis. One has the
    fitted inertias and trim torque, the other has the profile's values.

    The key ``explains_with_causes`` is the result of a second comparison, whose two simulations
    contain the causes. It is True if the fitted values remove most of the error of at least one
    axis in this second comparison. It is None if there are no causes, or if the second comparison
    was not made.
    """
    with_causes = None if f is None else f.refit_with_causes
    return {
        **_gain(None if f is None else f.refit),
        "explains_with_causes": with_causes and with_causes.removes_most_error,
    }


def _gain(g: Gain | None, f: Fitted | None = None) -> dict[str, Any]:
    """Return the JSON object of a gain: how much better a changed model predicts held-out data.

    The object contains the RMSE of the predictions with the model before and after the change. It
    also contains the decrease of the RMSE and the increase of the log-likelihood, each with its
    95 % interval. If ``f`` is given, the object contains the noise floor too: the RMSE that the
    true model would have.
    """
    rmse: dict[str, Any] = {"before": dict.fromkeys(AXES), "after": dict.fromkeys(AXES)}
    if g is not None:
        rmse = {"before": dict(g.before), "after": dict(g.after)}
    if f is not None or g is None:
        rmse["noise_floor"] = dict.fromkeys(AXES) if f is None else dict(f.noise_floor)
    if g is None:
        return {"holdout_rmse_deg": rmse, "holdout_log_likelihood": None}
    likelihood = g.log_likelihood
    return {
        "holdout_rmse_deg": rmse,
        "holdout_log_likelihood": likelihood and likelihood.value,
        "holdout_log_likelihood_interval": likelihood and [likelihood.low, likelihood.high],
        "rmse_reduction_deg": {
            a: x and {"value": x.value, "interval": [x.low, x.high]} for a, x in g.rmse_deg.items()
        },
        "measured_on": g.on,
    }


def _cause(x: Fault | Finding | OffNominal) -> dict[str, Any]:
    """Return the JSON object of a cause; ``gain`` states how much its term improves predictions.

    This gain is not measured for a fault of a recording, or for a base parameter (thrust gain, trim
    torque or inertia) that is off nominal. All numbers in their ``gain`` are None.
    """
    if isinstance(x, Fault):
        value, std = next(iter(x.parameters.values()), (0.0, 0.0))
        score = (value / std) ** 2 if std > 0 else 0.0
        out = _cause_object(x.effect, x.axis, x.parameters, score, x.confidence)
        return {**out, "allowed_for": x.allowed_for}
    effect, axis = x.term.effect, x.term.axis
    if isinstance(x, OffNominal):
        values = {effect.parameters[0].name: (x.value, x.std)}
        return _cause_object(effect.name, axis, values, x.score, x.confidence, x.tied_with)
    out = _cause_object(
        effect.name, axis, x.values, x.score, x.choice.confidence, x.tied_with, x.gain
    )
    return {**out, "like": x.unconfirmed}


def _cause_object(
    effect: str | None, axis: str | None, values: Mapping[str, tuple[float, float]], score: float,
    confidence: float, tied_with: Sequence[str] = (), gain: Gain | None = None,
) -> dict[str, Any]:  # fmt: skip
    return {
        "effect": effect,
        "axis": axis,
        "parameters": {n: {"value": v, "std": s} for n, (v, s) in values.items()},
        "score": score,
        "confidence": confidence,
        "tied_with": list(tied_with),
        "gain": _gain(gain),
    }


def _residual_torque(x: ResidualTorque) -> dict[str, Any]:
    """Return the JSON object of an unmodelled torque.

    It also contains the term by which the extended model describes this torque, if there is one.
    """
    t = x.term
    f = t if t is not None and t.proposal.is_formula else None
    return {
        "axis": x.axis,
        "depends_on": x.depends_on,
        "share": x.share,
        "table": [list(row) for row in x.table],
        "std": list(x.std),
        "score": x.score,
        "confidence": x.confidence,
        "also": list(x.also),
        "like": x.resembles,
        "term": None if t is None else t.proposal.term,
        "formula": None if f is None else f"c * {f.proposal.product.replace('*', ' * ')}",
        "formula_parameters": {} if f is None else {"c": _coefficient(f)},
        "formula_alternatives": [] if f is None else list(f.proposal.alternatives),
        "error_deg": None,
        "gain": _gain(None if t is None else t.gain),
    }


def _remainder(r: UnexplainedError) -> dict[str, Any]:
    """Return the JSON object of a prediction error that neither causes nor noise explain.

    The document lists such an error as an unmodelled torque that depends on no known variable. So
    the object has the same keys as that of `_residual_torque`. ``error_deg`` contains the error of
    the simulation, the error of the extended model, and the noise floor.
    """
    torque = ResidualTorque(r.axis, "", 0.0, (), (), 0.0, 0.0)
    return {
        **_residual_torque(torque),
        **dict.fromkeys(("depends_on", "score", "confidence")),
        "error_deg": {
            "simulation": r.simulation_deg,
            "extended_model": r.extended_deg,
            "noise_floor": r.noise_deg,
        },
    }


def _coefficient(f: TorqueTerm) -> dict[str, Any]:
    value, std = f.values["coefficient"]
    return {"value": value, "std": std, "unit": term(f.proposal.term).effect.parameters[0].unit}


def _recommendation(n: NextExperiment) -> dict[str, Any]:
    """Return the JSON object of the recommended plan, with the expected results of all plans.

    ``certainty`` is the probability that a flight of the plan decides between the causes.
    """
    return {
        "plan": n.plan,
        "separates": list(n.separates),
        "why": n.why,
        "certainty": n.certainty,
        "ranking": [
            {k: getattr(o, k) for k in ("plan", "duration_s", "margin", "certainty")}
            for o in n.ranking
        ],
    }


def _catalogue_recommendation(d: Diagnosis) -> dict[str, Any] | None:
    """Return a JSON object with the flight plan that the catalogue of effects recommends, or None.

    Some confounded causes can be separated by a further flight (`separable_by_flight`). The
    function finds the first cause that is confounded with such causes. The plan is the attribute
    ``separated_by`` of this cause's effect. If the attribute is empty, the plan is "rich", a
    general excitation. If no confounded causes can be separated, the function returns None.
    """
    for cause in physical(in_order_of_selection(d.faults, d.findings, d.calibration_findings)):
        name = cause.term.name
        if others := separable_by_flight(name, cause.tied_with):
            plan = cause.term.effect.separated_by or "rich"
            return {
                "plan": plan,
                "separates": [name, *others],
                "why": f"{name} and {', '.join(others)} fit this recording equally well. {plan} is "
                f"the catalogue's plan for {name}; this diagnosis did not compare plans in "
                "simulation (heli3dof diagnose without --quick does, and next_experiment in "
                "Python)",
            }
    return None


def _finite_or_none(value: float) -> float | None:
    """Return the value, or None if it is not finite: JSON has neither NaN nor infinity."""
    return value if math.isfinite(value) else None
