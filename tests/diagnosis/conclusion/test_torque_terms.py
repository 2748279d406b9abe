"""An unmodelled torque that improves predictions enters the model; another is dropped."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from heli3dof.axes import AXES
from heli3dof.diagnosis.conclusion import torque_terms
from heli3dof.diagnosis.conclusion.adoption import AdoptionResult
from heli3dof.diagnosis.conclusion.torque_terms import with_torques
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.gain import Interval

SETUP: Any = SimpleNamespace(seed=0)
TORQUE = ResidualTorque("roll", "yaw", 0.5, (), (), 100.0, 1.0)


def extended(
    monkeypatch: pytest.MonkeyPatch, gains: dict[str, tuple[float, float, float]]
) -> AdoptionResult:
    """The result for a torque whose proposals have these gains: Δℓ, its lowest value, ΔRMSE's."""
    results = [
        SimpleNamespace(
            log_likelihood=Interval(value, low, 3 * value),
            rmse_deg={a: Interval(0.1, rmse_low, 0.3) for a in AXES},
        )
        for value, low, rmse_low in gains.values()
    ]
    fit = SimpleNamespace(optimum=SimpleNamespace(loglik=0.0))
    proposals = [SimpleNamespace(term=name) for name in gains]
    monkeypatch.setattr(torque_terms, "proposals", lambda *a: proposals)
    monkeypatch.setattr(torque_terms, "fit_with", lambda *a: fit)
    monkeypatch.setattr(torque_terms, "held_out", lambda *a: None)
    monkeypatch.setattr(torque_terms, "gain", lambda *a, **k: results.pop(0))
    monkeypatch.setattr(torque_terms, "thrust_scale", lambda fit: None)
    monkeypatch.setattr(torque_terms, "in_SI", lambda fit, scale, name: {})
    start = AdoptionResult(cast(Any, None), (), (), cast(Any, None), (TORQUE,))
    return with_torques(SETUP, start, [])


@pytest.mark.parametrize(
    "gain",
    [
        (30.0, 5.0, -0.1),  # significantly more likely
        (570.0, -94.0, 0.5),  # rigs-outside 3111: few blocks, but a much smaller prediction error
    ],
)
def test_a_torque_that_predicts_better_enters_the_model(
    monkeypatch: pytest.MonkeyPatch, gain: tuple[float, float, float]
) -> None:
    result = extended(monkeypatch, {"formula": gain, "curve": gain})
    assert [t.term.proposal.term for t in result.residual_torques if t.term] == ["formula"]
    assert not result.dropped


def test_a_torque_that_does_not_is_dropped_with_its_best_proposal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    result = extended(monkeypatch, {"formula": (21.6, -10.0, -0.1), "curve": (-38.0, -82.0, -0.1)})
    assert result.residual_torques == ()
    assert [d.name for d in result.dropped] == ["formula"]


def test_a_torque_that_cannot_be_fitted_stays_without_a_term(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    result = extended(monkeypatch, {})
    assert (result.residual_torques, result.dropped) == ((TORQUE,), ())
