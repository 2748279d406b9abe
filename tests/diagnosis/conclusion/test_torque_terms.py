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
from heli3dof.rig.profile import default_profile

SETUP: Any = SimpleNamespace(seed=0)
TORQUE = ResidualTorque("roll", "yaw", 0.5, (), (), 100.0, 1.0)


def extended(
    monkeypatch: pytest.MonkeyPatch,
    gains: dict[str, tuple[float, float, float]],
    roll: Interval | None = None,
) -> AdoptionResult:
    """The result for a torque whose proposals have these gains: Δℓ, its lowest value, ΔRMSE's.

    ``roll``: ΔRMSE of roll, if it is not that of the other axes.
    """
    own = {"roll": roll} if roll else {}
    results = [
        SimpleNamespace(
            log_likelihood=Interval(value, low, 3 * value),
            rmse_deg={a: Interval(0.1, rmse_low, 0.3) for a in AXES} | own,
        )
        for value, low, rmse_low in gains.values()
    ]
    structure = SimpleNamespace(profile=default_profile())
    fit = SimpleNamespace(optimum=SimpleNamespace(loglik=0.0), structure=structure)
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


def test_a_torque_that_worsens_predictions_of_an_axis_and_improves_none_is_dropped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Angles averaged over 25 rows: a torque on pitch increased the error of roll by 0.12°."""
    worse = Interval(-0.12, -0.20, -0.05)
    result = extended(monkeypatch, {"formula": (49.0, 34.0, -0.06)}, worse)
    assert [d.name for d in result.dropped] == ["formula"]
    result = extended(monkeypatch, {"formula": (49.0, 34.0, 0.06)}, worse)
    assert not result.dropped


def test_a_torque_that_cannot_be_fitted_stays_without_a_term(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    result = extended(monkeypatch, {})
    assert (result.residual_torques, result.dropped) == ((TORQUE,), ())
