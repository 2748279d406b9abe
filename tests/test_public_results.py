"""The public results: text, table, figure and report of a diagnosis, short reprs, pickling."""

from __future__ import annotations

import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import heli3dof as h3
from heli3dof.errors import UsageError
from heli3dof.integrity import Fault, Kind
from heli3dof.model.greybox.model import nominal
from tests.flown import flown
from tests.profiles import profile

DEVICE = "mock:?speed=max&hide=motor.lag:0.1"


@pytest.fixture(scope="module")
def recording() -> h3.Recording:
    return flown("rich", 30.0, device=DEVICE, seed=1, profile=profile(rate_hz=250.0))


@pytest.fixture(scope="module")
def diagnosis(recording: h3.Recording) -> h3.Diagnosis:
    return h3.diagnose(recording, quick=True)


def test_a_diagnosis_has_the_methods_of_a_result(diagnosis: h3.Diagnosis) -> None:
    document = diagnosis.to_dict()
    assert document == h3.diagnosis_document(diagnosis)
    assert diagnosis.summary() == "\n".join(h3.diagnosis_summary(document))
    assert "motor.lag" in diagnosis._repr_html_()
    assert repr(diagnosis) == diagnosis.summary()
    assert repr(diagnosis).startswith("Verdict: ")
    size = diagnosis.to_dataframe().loc[("motor.lag", "time_constant_s")]
    assert size["value"] == pytest.approx(0.1, abs=0.02)
    labels = [text.get_text() for text in diagnosis.plot().axes[0].get_legend().get_texts()]
    assert labels == ["refitted simulation", "extended model", "noise floor"]


def test_a_diagnosis_of_faulty_data_has_text_and_an_empty_table_but_no_figure() -> None:
    fault = Fault("clock.backwards", Kind.BAD_DATA, "a", "Time runs backwards.", "a merge.", "sort")
    refused = h3.Diagnosis(("a",), (), "bad_data", (fault,))
    assert "Time runs backwards" in refused.summary()
    assert len(refused.to_dataframe()) == 0
    with pytest.raises(UsageError, match="no figure of this diagnosis"):
        refused.plot()


def test_the_table_of_a_diagnosis_has_the_formula_of_an_unmodelled_torque(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    c = {"value": 0.02, "std": 0.001, "unit": "N·m·s/rad"}
    formula = {"term": "empirical.yaw.1", "formula": "c * pitch_rate", "score": 90.0,
               "confidence": 0.9, "formula_parameters": {"c": c}}  # fmt: skip
    tabulated = {**formula, "formula": None, "formula_parameters": {}}
    document = {"findings": [], "leftover": [formula, tabulated]}
    monkeypatch.setattr(h3.Diagnosis, "to_dict", lambda self: document)
    table = h3.Diagnosis(("a",), (), "unexplained", ()).to_dataframe()
    assert list(table.index) == [("empirical.yaw.1: c * pitch_rate", "c")]
    assert list(table.iloc[0]) == [0.02, 0.001, 90.0, 0.9]


def test_other_results_have_a_repr_of_at_most_three_lines(
    recording: h3.Recording, diagnosis: h3.Diagnosis
) -> None:
    path = Path("flights/1-rich.mcap")
    auto = h3.AutoResult(path.parent, (path,), (recording,), diagnosis, None, "settled")
    flight = h3.fly_plan(h3.step_plan((5.0, None, None)), device="mock:?speed=max")
    for result in (auto, flight):
        assert len(repr(result).splitlines()) <= 3
        assert len(repr(result)) < 500
    assert "1 flight(s) in flights" in repr(auto)
    assert "completed" in repr(flight)


def test_the_repr_of_a_cause_states_its_size_in_one_line(diagnosis: h3.Diagnosis) -> None:
    (cause,) = diagnosis.findings
    number = "[-0-9.e]+"
    pattern = rf"Finding\(motor.lag: time_constant_s = {number} ± {number}\)"
    assert re.fullmatch(pattern, repr(cause))


def test_a_report_takes_what_diagnose_returns(
    recording: h3.Recording, diagnosis: h3.Diagnosis
) -> None:
    page = h3.flight_report([recording], diagnosed=diagnosis)
    assert "motor.lag" in page
    assert "<h2>Diagnosis</h2>" in page or ">Diagnosis<" in page


def pickled(result: Any) -> Any:
    return pickle.loads(pickle.dumps(result))


@pytest.mark.parametrize("options", [{}, {"method": "pem", "order": 6}, {"method": "tf4"}])
def test_an_identification_can_be_pickled_after_use(
    recording: h3.Recording, options: dict[str, Any]
) -> None:
    result = h3.identify(recording, **options)
    omega = np.array([1.0, 3.0])
    copy = pickled(result)
    assert copy.summary() == result.summary()
    for a, b in zip(copy.frequency_response(omega), result.frequency_response(omega), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-10)  # unpickled arrays may be stored by columns
    expected = result.model.predict(recording, 0.5)
    np.testing.assert_array_equal(pickled(result.model).predict(recording, 0.5), expected)
    np.testing.assert_array_equal(pickled(result).model.predict(recording, 0.5), expected)


def test_the_other_results_can_be_pickled_after_use(
    recording: h3.Recording, diagnosis: h3.Diagnosis
) -> None:
    assert diagnosis.fitted is not None
    model = diagnosis.fitted.model
    expected = model.predict(recording, 0.5)
    copy = pickled(diagnosis)
    assert copy.to_dict() == diagnosis.to_dict()
    np.testing.assert_array_equal(copy.fitted.model.predict(recording, 0.5), expected)
    comparison = h3.compare([recording], [model], horizons_s=(0.5,))
    assert pickled(comparison).to_dict() == comparison.to_dict()
    flight = h3.fly_plan(h3.step_plan((5.0, None, None)), device="mock:?speed=max")
    assert pickled(flight).recording.digest == flight.recording.digest


def test_every_kind_of_model_is_sampled_at_another_interval() -> None:
    hover, body = (h3.hover_model(h3.default_profile()), nominal(h3.default_profile()))
    for model in (hover, body):
        assert model.to_control(dt=0.02).dt == 0.02
        assert model.to_control(in_continuous_time=True, dt=0.02).dt == 0
