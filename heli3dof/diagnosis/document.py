"""The contract's document of a diagnosis, ``heli3dof.diagnosis/1``: every key, always."""

from __future__ import annotations

import itertools
import math
from typing import Any

from heli3dof.axes import AXES
from heli3dof.diagnosis.conclusion.encoder_scales import flyable
from heli3dof.diagnosis.estimate.base_parameters import (
    BaseParameter,
    OffNominal,
    base_parameters,
    finding_of,
)
from heli3dof.diagnosis.integrity import Fault
from heli3dof.diagnosis.outlook import NextExperiment
from heli3dof.diagnosis.planning.free_run_plan import why_none
from heli3dof.diagnosis.profile_update import Measured, profile_keys, ratios
from heli3dof.diagnosis.result import Diagnosis, Finding, Fitted, TorqueTerm
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.gain import HORIZON_S, Gain


def diagnosis_document(
    d: Diagnosis, model: str | None = None, upcoming: NextExperiment | None = None
) -> dict[str, Any]:
    """JSON-able; ``model`` is the extended model's path, None where it was not written.

    ``upcoming`` is what `planning.next_experiment.next_experiment` says; without it the
    catalogue's own recommendation for the first tie stands there. Beside the contract's keys:
    ``integrity`` (every fault), ``dropped`` (causes that do not pay), ``about``, and what
    `_calibration` says of the tolerance.
    """
    f = d.fitted
    about, following = dict(d.about), _next(d) if upcoming is None else _upcoming(upcoming)
    if following is None and f is not None and f.final is None:
        about["no_next_experiment"] = why_none(f.open)
    return {
        "schema": "heli3dof.diagnosis/1",
        "recordings": list(d.recordings),
        "holdout": list(d.holdout),
        "verdict": d.verdict,
        "simulation_error": {a: _wrong(f, a) for a in AXES},
        "calibration": [] if f is None else _calibration(d, f),
        "calibration_gain": _gain(None if f is None else f.refit),
        "profile": _profile(f),
        "ratios": _ratios(f),
        "findings": [_found(x) for x in d.in_order],
        "not_identifiable": list(d.not_identifiable),
        "leftover": [
            _leftover(x, term) for x, term in itertools.zip_longest(d.leftovers, d.torque_terms)
        ],
        "next_experiment": following,
        "gain": {"horizon_s": HORIZON_S, **_gain(None if f is None else f.gain, f)},
        "model": model,
        "integrity": [x.to_dict() for x in d.integrity],
        "dropped": [{"effect": x.name, "why": x.why, "gain": _gain(x.gain)} for x in d.dropped],
        "about": about,
    }


def _wrong(f: Fitted | None, axis: str) -> dict[str, Any]:
    """The simulation as the profile has it, and over every horizon."""
    if f is None:
        return {"rmse_deg": None, "noise_floor_deg": None, "horizon_s": HORIZON_S}
    error, floor = (_number(x) for x in f.wrong.at(HORIZON_S, axis))
    return {
        "rmse_deg": error,
        "noise_floor_deg": floor,
        "horizon_s": HORIZON_S,
        "by_horizon": [
            {
                "horizon_s": h,
                "rmse_deg": _number(f.wrong.at(h, axis)[0]),
                "noise_floor_deg": _number(f.wrong.at(h, axis)[1]),
            }
            for h in f.wrong.horizons_s
        ],
        "worst": [
            {
                "recording": w.recording,
                "start_s": w.start_s,
                "stop_s": w.stop_s,
                "rmse_deg": w.rmse_deg,
            }
            for w in f.wrong.worst
            if w.axis == axis
        ],
    }


def _calibration(d: Diagnosis, f: Fitted) -> list[dict[str, Any]]:
    """Each number of the base beside what the profile says, and to what share that is believed.

    ``beyond_tolerance``: "no"; "surely", it is a finding; or "not_surely", the estimate is beyond
    and its deviation, or what is left without a name, may be why.
    """
    tolerance = f.model.profile.tolerance
    found = {x.term.name for x in d.calibration_findings}
    found |= {x.choice.term.name for x in d.findings}

    def beyond(c: BaseParameter) -> str:
        if finding_of(c.name) in found:
            return "surely"
        return "not_surely" if c.beyond(tolerance) > 0 else "no"

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
        for c in (f.calibration if f.final is None else base_parameters(f.final))
    ]


def _measured(f: Fitted | None) -> dict[str, Measured]:
    """Return the base parameters in SI by name, K_f among them; empty where none were fitted."""
    numbers = () if f is None or f.final is None else base_parameters(f.final)
    return {c.name: Measured(c.nominal, c.value, c.std) for c in numbers}


def _profile(f: Fitted | None) -> list[dict[str, Any]]:
    """Return the calibration as keys of the profile; `profile update` writes these."""
    if f is None:
        return []
    keys = profile_keys(_measured(f), f.model.profile)
    return [{"key": k, "was": m.nominal, "value": m.value, "std": m.std} for k, m in keys.items()]


def _ratios(f: Fitted | None) -> list[dict[str, Any]]:
    """Return the ratios that these recordings determine, whatever K_f is."""
    if f is None:
        return []
    return [
        {"ratio": n, "nominal": m.nominal, "value": m.value, "std": m.std}
        for n, m in ratios(_measured(f), f.model.profile).items()
    ]


def _gain(g: Gain | None, f: Fitted | None = None) -> dict[str, Any]:
    """RMSE before and after on data not seen, with the intervals of what is won."""
    none = dict.fromkeys(AXES)
    out: dict[str, Any] = {
        "holdout_rmse_deg": {
            "before": none if g is None else dict(g.before),
            "after": none if g is None else dict(g.after),
        },
        "holdout_log_likelihood": None
        if g is None or g.log_likelihood is None
        else g.log_likelihood.value,
    }
    if f is not None:
        out["holdout_rmse_deg"]["noise_floor"] = dict(f.noise_floor)
    elif g is None:
        out["holdout_rmse_deg"]["noise_floor"] = none
    if g is not None:
        L = g.log_likelihood
        out["holdout_log_likelihood_interval"] = None if L is None else [L.low, L.high]
        out["rmse_reduction_deg"] = {
            a: None if x is None else {"value": x.value, "interval": [x.low, x.high]}
            for a, x in g.rmse_deg.items()
        }
        out["measured_on"] = g.on
    return out


def _found(x: Fault | Finding | OffNominal) -> dict[str, Any]:
    if isinstance(x, Finding):
        return _finding(x)
    return _off(x) if isinstance(x, OffNominal) else _fault(x)


def _finding(f: Finding) -> dict[str, Any]:
    return {
        "effect": f.choice.term.effect.name,
        "axis": f.choice.term.axis,
        "parameters": {n: {"value": v, "std": s} for n, (v, s) in f.values.items()},
        "score": f.choice.score,
        "confidence": f.choice.confidence,
        "tied_with": list(f.choice.tied_with),
        "like": f.like,
        "gain": _gain(f.gain),
    }


def _fault(f: Fault) -> dict[str, Any]:
    """A cause in the recording itself; nothing is extended for it, so nothing is gained."""
    value, std = next(iter(f.parameters.values()), (0.0, 0.0))
    return {
        "effect": f.effect,
        "axis": f.axis,
        "parameters": {n: {"value": v, "std": s} for n, (v, s) in f.parameters.items()},
        "score": (value / std) ** 2 if std > 0 else 0.0,
        "confidence": f.confidence,
        "tied_with": [],
        "gain": _gain(None),
    }


def _off(x: OffNominal) -> dict[str, Any]:
    """A base parameter that is off its nominal; its gain is calibration, which is no gain."""
    return {
        "effect": x.term.effect.name,
        "axis": x.term.axis,
        "parameters": {x.term.effect.parameters[0].name: {"value": x.value, "std": x.std}},
        "score": x.score,
        "confidence": 1.0,
        "tied_with": list(x.tied_with),
        "gain": _gain(None),
    }


def _leftover(x: ResidualTorque, t: TorqueTerm | None) -> dict[str, Any]:
    """Return an unmodelled torque with the extended model's term for it."""
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
        "like": x.like,
        "term": None if t is None else t.proposal.term,
        "formula": None if f is None else f"c * {f.proposal.product.replace('*', ' * ')}",
        "formula_parameters": {} if f is None else {"c": _coefficient(f)},
        "formula_alternatives": [] if f is None else list(f.proposal.alternatives),
        "gain": _gain(None if t is None else t.gain),
    }


def _coefficient(f: TorqueTerm) -> dict[str, Any]:
    value, std = f.values["coefficient"]
    return {"value": value, "std": std, "unit": f.units["coefficient"]}


def _upcoming(n: NextExperiment) -> dict[str, Any]:
    """With the chance that it settles the matter, and what every plan promised."""
    return {
        "plan": n.plan,
        "separates": list(n.separates),
        "why": n.why,
        "certainty": n.certainty,
        "ranking": [
            {
                "plan": o.plan,
                "duration_s": o.duration_s,
                "margin": o.margin,
                "certainty": o.certainty,
            }
            for o in n.ranking
        ],
    }


def _next(d: Diagnosis) -> dict[str, Any] | None:
    """The plan that separates the first tie that a flight can separate, by the catalogue."""
    ties = (
        (x.term, x.tied_with) if isinstance(x, OffNominal) else (x.choice.term, x.choice.tied_with)
        for x in d.in_order
        if not isinstance(x, Fault)
    )
    for term, tied_with in ties:
        if others := flyable(term.name, tied_with):
            return {
                "plan": term.effect.separated_by or "rich",
                "separates": [term.name, *others],
                "why": f"{term.name} and {', '.join(others)} fit this recording equally well",
            }
    return None


def _number(value: float) -> float | None:
    """JSON knows neither NaN nor infinity."""
    return value if math.isfinite(value) else None
