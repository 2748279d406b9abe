"""The Python API: public names are listed, found, documented, and do what the commands do."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import heli3dof as h3

PUBLIC = {
    "Comparison", "Controller", "Diagnosis", "Flight", "Identification", "LinearModel", "Plan",
    "Profile", "Recording", "check_loop", "compare", "comparison_document", "comparison_figures",
    "default_profile", "diagnose", "diagnosis_document", "export", "file_info", "find_rigs",
    "flight_figure", "flight_metrics", "flight_report", "fly_plan", "hover_model", "identify",
    "import_log", "load", "load_model", "load_plan", "load_profile", "make_recording", "open_rig",
    "plan_from_dict", "profile_from_dict", "read_recording", "recover", "save_model", "simulate",
    "step_plan", "write_recording",
}  # fmt: skip


def test_the_public_names_are_these() -> None:
    assert set(h3.__all__) == PUBLIC == set(h3._HOME) == set(dir(h3))


@pytest.mark.parametrize("name", sorted(PUBLIC))
def test_every_public_name_is_found_and_documented(name: str) -> None:
    thing = getattr(h3, name)
    assert inspect.isclass(thing) or callable(thing)
    assert thing.__doc__
    assert len(thing.__doc__) > 20


@pytest.mark.parametrize("name", sorted(PUBLIC))
def test_a_public_name_stays_what_it_is_once_its_package_is_imported(name: str) -> None:
    for package in (
        "comparison", "diagnosis", "experiment", "identification", "model", "recording", "report",
    ):  # fmt: skip
        __import__(f"heli3dof.{package}")
    assert not inspect.ismodule(getattr(h3, name))


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'compere'"):
        _ = h3.compere


def test_importing_the_package_imports_nothing_heavy() -> None:
    code = (
        "import heli3dof, sys; print([m for m in ('numpy', 'scipy', 'numba') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_fly_record_identify_compare_and_report_in_python(tmp_path: Path) -> None:
    device = "mock:?speed=max&seed={}&start=level&hide=motor.lag:0.1"
    train = h3.fly_plan(h3.load_plan("multisine"), device=device.format(1), seed=1)
    test = h3.fly_plan(
        h3.step_plan((5.0, None, 10.0), settle_s=1.0, duration_s=10.0),
        device=device.format(2),
        output=tmp_path / "step.mcap",
    )
    found = h3.identify(train.recording, holdout=test.recording)
    h3.save_model(found.model, tmp_path / "m.json")
    model = h3.load_model(tmp_path / "m.json", test.recording.profile)
    compared = h3.compare(
        [h3.load(tmp_path / "step.mcap")], [h3.hover_model(h3.default_profile()), model]
    )
    assert compared.flights[0].loop == "replayed"
    assert h3.comparison_document(compared)["schema"] == "heli3dof.comparison/1"
    page = h3.flight_report([test.recording], comparison=compared)
    assert "step" in page
    flown = h3.simulate(h3.step_plan((5.0, None, None)), model, start="level")
    assert np.isfinite(flown.angle).all()


def test_a_flight_that_says_too_little_gives_a_model_that_is_warned_of() -> None:
    flight = h3.fly_plan(h3.step_plan((10.0, None, None)), device="mock:?speed=max&seed=1")
    found = h3.identify(flight.recording, method="pem")
    assert any("heli3dof run multisine" in w and "roll" in w for w in found.warnings)
