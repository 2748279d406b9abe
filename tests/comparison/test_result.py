from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.comparison.compare import compare
from heli3dof.comparison.document import comparison_document
from heli3dof.comparison.metrics import METRICS
from heli3dof.comparison.result import Comparison
from heli3dof.rig.profile import default_profile
from tests.comparison.fakes import FakeHover, flight
from tests.recording.make import changed


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    unknown = default_profile().model_copy(update={"controller": None})
    flights = [flight(name="one"), replace(flight(), profile=unknown, meta={"name": "two"})]
    return compare(flights, [FakeHover(), FakeHover(name="weak", thrust=0.8)])


def test_the_repr_is_three_lines_with_each_models_errors(comparison: Comparison) -> None:
    first, second, third = repr(comparison).splitlines()
    assert first.startswith("Comparison of hover, weak with 2 recordings")
    assert second.startswith("  one, closed-loop replay: hover 0.00°, 0.00°, 0.00°; weak ")
    assert third.startswith("  two, predictions 0 to 3 s ahead: hover ")


def test_the_summary_has_a_dash_for_an_axis_without_an_error() -> None:
    one_axis = changed(flight(name="one"), "angle", (slice(None), 2), np.nan)
    comparison = compare([one_axis], [FakeHover()])
    assert "nan" not in comparison.summary()
    assert ", –" in repr(comparison)


def test_the_summary_has_the_warnings(comparison: Comparison) -> None:
    assert "two: not replayed: the controller is unknown" in comparison.summary()
    assert comparison._repr_html_().startswith("<pre>Comparison of hover, weak")


def test_the_dict_is_the_document(comparison: Comparison) -> None:
    assert comparison.to_dict() == comparison_document(comparison)


def test_the_data_frame_has_a_row_per_recording_model_and_axis(comparison: Comparison) -> None:
    pytest.importorskip("pandas")
    frame = comparison.to_dataframe()
    assert frame.index.names == ["recording", "model", "axis"]
    assert len(frame) == 2 * 3 * 3
    assert set(METRICS) | {"replay_rmse_deg", "rmse_deg_0.5_s"} <= set(frame)
    peak = comparison.flights[0].models[1].metrics["roll"].reported.peak_deg  # type: ignore[index]
    assert frame.loc[("one", "weak", "roll"), "peak_deg"] == peak
