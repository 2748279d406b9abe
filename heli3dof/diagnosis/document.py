"""The contract's document of a diagnosis, ``heli3dof.diagnosis/1``: every key, always."""

from __future__ import annotations

from typing import Any

from heli3dof.axes import AXES
from heli3dof.diagnosis.diagnose import Diagnosis, Finding
from heli3dof.diagnosis.gain import HORIZON_S
from heli3dof.diagnosis.next_experiment import NextExperiment
from heli3dof.model.effects import term


def document(
    d: Diagnosis, model: str | None = None, upcoming: NextExperiment | None = None
) -> dict[str, Any]:
    """JSON-able; ``model`` is the extended model's path, None where it was not written.

    ``upcoming`` is what `heli3dof.diagnosis.next_experiment.next_of` says; without it the
    catalogue's own recommendation for the first tie stands there.
    """
    calibration = [
        {
            "parameter": f.name,
            "nominal": f.start,
            "value": float(v),
            "std": float(s),
            "unit": f.unit,
        }
        for f, v, s in zip(d.final.free[:4], d.final.values[:4], d.final.std[:4], strict=True)
    ]
    return {
        "schema": "heli3dof.diagnosis/1",
        "recordings": list(d.recordings),
        "holdout": list(d.holdout),
        "verdict": d.verdict,
        "simulation_error": {
            a: {
                "rmse_deg": d.simulation_error[a],
                "noise_floor_deg": d.noise_floor[a],
                "horizon_s": HORIZON_S,
            }
            for a in AXES
        },
        "calibration": calibration,
        "findings": [
            *(_finding(f) for f in d.findings),
            *(_off(d, n) for n in d.calibration_findings),
        ],
        "not_identifiable": list(d.not_identifiable),
        "leftover": [],
        "next_experiment": _next(d) if upcoming is None else _upcoming(upcoming),
        "gain": {
            "horizon_s": HORIZON_S,
            "holdout_rmse_deg": {
                "before": d.before, "after": d.after, "noise_floor": d.noise_floor,
            },
        },
        "model": model,
        "about": d.about,
    }  # fmt: skip


def _finding(f: Finding) -> dict[str, Any]:
    return {
        "effect": f.choice.term.effect.name,
        "axis": f.choice.term.axis,
        "parameters": {n: {"value": v, "std": s} for n, (v, s) in f.values.items()},
        "score": f.choice.score,
        "confidence": f.choice.confidence,
        "tied_with": list(f.choice.tied_with),
        "gain": {
            "holdout_rmse_deg": {"before": f.before, "after": f.after},
            "holdout_log_likelihood": f.log_likelihood,
        },
    }


def _off(d: Diagnosis, name: str) -> dict[str, Any]:
    """A base parameter that is off its nominal, as a finding."""
    t = term(name)
    i = {"mass.imbalance": 0, "motor.thrust_gain": 0}.get(name)
    i = 1 + AXES.index(t.axis) if t.axis is not None else i
    assert i is not None
    f, v, s = d.final.free[i], float(d.final.values[i]), float(d.final.std[i])
    value, std = {
        "mass.imbalance": (v - f.start, s),
        # All others are estimated in units of K_f, so they fall where the gain rises.
        "motor.thrust_gain": (f.start / v, abs(f.start) * s / v**2),
    }.get(name, (v / f.start, s / f.start))
    return {
        "effect": t.effect.name,
        "axis": t.axis,
        "parameters": {t.effect.parameters[0].name: {"value": value, "std": std}},
        "score": ((v - f.start) / s) ** 2,
        "confidence": 1.0,
        "tied_with": [],
        "gain": {
            "holdout_rmse_deg": {"before": d.before, "after": d.before},
            "holdout_log_likelihood": 0.0,
        },
    }


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
    """The plan that separates the first tie, by the catalogue."""
    for f in d.findings:
        if f.choice.tied_with:
            effect = f.choice.term.effect
            return {
                "plan": effect.separated_by or "rich",
                "separates": [f.choice.term.name, *f.choice.tied_with],
                "why": f"{f.choice.term.name} and {', '.join(f.choice.tied_with)} fit this "
                "recording equally well",
            }
    return None
