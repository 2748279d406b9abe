"""The verdict on a comparison, from errors chosen by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from heli3dof.comparison.result import (
    Comparison,
    FlightComparison,
    ModelComparison,
    PredictionError,
)
from heli3dof.comparison.verdict import prediction_errors, verdict


def ahead(*by_horizon: list[float]) -> PredictionError:
    errors = dict(zip((0.5, 1.0), map(np.array, by_horizon), strict=False))
    return PredictionError(errors, np.zeros(3), 1.0)


def model(name: str, error: PredictionError | None, replay: list[float] | None) -> ModelComparison:
    rmse = None if replay is None else np.array(replay)
    return ModelComparison(name, "greybox", None, rmse, None, (), error, None, ())


def flight(still: PredictionError, *models: ModelComparison) -> FlightComparison:
    nothing: Any = None
    flown: Any = SimpleNamespace(identified_controller=None)
    return FlightComparison(nothing, flown, {}, "replayed", None, still, models)


STILL = ahead([1.0, 0.1, 1.0], [2.0, 0.2, 2.0])
HOVER = model("hover", ahead([0.9, 0.4, 0.5], [1.5, 0.6, 1.0]), [0.6, 0.5, 0.4])
GREY = model("grey box", ahead([0.3, 0.2, 0.5], [0.6, 0.4, 1.0]), [0.1, np.nan, 0.4])


def sentences(*models: ModelComparison) -> tuple[str, ...]:
    return verdict(Comparison((flight(STILL, *models),), (0.5, 1.0)))


def test_the_best_model_is_named_by_axis_with_the_other_s_error() -> None:
    assert sentences(HOVER, GREY)[0] == (
        "RMSE of predictions 1 s ahead: grey box is best on roll (0.60°, hover 1.50°), pitch "
        "(0.40°, hover 0.60°); hover and grey box are best on yaw (1.00°)."
    )


def test_a_model_that_is_worse_than_constant_angles_is_named() -> None:
    _, worse, never, *_ = sentences(HOVER, GREY)
    assert worse == "Worse than constant angles 1 s ahead: hover on pitch; grey box on pitch."
    assert never == "No model is better than constant angles on pitch 0.5 and 1 s ahead."


def test_a_diverging_model_is_not_the_best_replay() -> None:
    assert "hover is best on pitch (0.50°)" in sentences(HOVER, GREY)[-1]


def test_a_single_model_is_not_called_the_best() -> None:
    first = sentences(HOVER)[0]
    assert first.startswith("RMSE of predictions 1 s ahead, hover: roll 1.50°, pitch")


def test_models_are_judged_on_the_recordings_that_all_predict() -> None:
    alone = flight(STILL, HOVER, model("grey box", None, None))
    both = flight(STILL, HOVER, model("grey box", ahead([3.0, 3.0, 3.0]), None))
    errors = prediction_errors(Comparison((alone, both), (0.5,)), 0.5)
    assert errors["grey box"].tolist() == [3.0, 3.0, 3.0]
    hover_twice = prediction_errors(Comparison((both, both), (0.5,)), 0.5)["hover"]
    assert np.allclose(errors["hover"], hover_twice)


def test_nothing_compared_is_a_sentence() -> None:
    assert sentences() == ("No model was compared.",)
    only = sentences(model("grey box", None, None))
    assert only == ("No model could be compared; the warnings state why.",)
