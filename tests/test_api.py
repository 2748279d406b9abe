"""The Python API: public names import, are documented, typed, and work like the commands."""

from __future__ import annotations

import inspect
import subprocess
import sys
import typing
from pathlib import Path

import numpy as np
import pytest

import heli3dof as h3
from heli3dof.cli.app import app
from heli3dof.errors import Heli3dofError
from heli3dof.rig.session.client import running
from tests.flown import first_part
from tests.rig.fakes import FakeDriver, only_drivers

IMPORT_S = 0.05
"""s that ``import heli3dof`` may take; 0.001 s on the machine where it was written"""
NAMES: list[str] = list(h3.__all__)


def test_the_list_of_public_names_is_the_stub_of_the_package() -> None:
    assert dir(h3) == NAMES == sorted(set(NAMES))
    for name in ("open_rig", "run_auto", "zero", "doctor", "estop", "next_experiment", "effects"):
        assert name in NAMES


@pytest.mark.parametrize("name", NAMES)
def test_every_public_name_is_documented_and_typed(name: str) -> None:
    thing = getattr(h3, name)
    assert inspect.isclass(thing) or callable(thing)
    if inspect.isclass(thing) and issubclass(thing, Heli3dofError):
        return
    assert thing.__doc__
    assert len(thing.__doc__) > 20
    function = inspect.unwrap(thing)
    if inspect.isfunction(function):
        signature = inspect.signature(function)
        untyped = [p.name for p in signature.parameters.values() if p.annotation is p.empty]
        assert untyped == []
        assert signature.return_annotation is not signature.empty


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_is_never_replaced_by_a_module_of_that_name(name: str) -> None:
    for package in (
        "comparison", "diagnosis", "experiment", "identification", "model", "recording", "report",
    ):  # fmt: skip
        __import__(f"heli3dof.{package}")
    assert not inspect.ismodule(getattr(h3, name))


def test_every_error_of_the_package_is_public() -> None:
    from heli3dof import errors

    for name, thing in vars(errors).items():
        if inspect.isclass(thing) and issubclass(thing, Heli3dofError):
            assert name in NAMES


def test_the_package_has_its_version() -> None:
    from importlib.metadata import version

    assert h3.__version__ == version("heli3dof")


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'compere'"):
        _ = h3.compere


def test_importing_the_package_is_quick_and_imports_nothing_heavy() -> None:
    code = (
        "import sys, time; s = time.process_time(); import heli3dof; t = time.process_time() - s\n"
        "print(t); print([m for m in ('ast', 'numpy', 'scipy', 'numba', 'typer') "
        "if m in sys.modules])"
    )
    done = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        for _ in range(3)
    ]
    assert min(float(d.stdout.splitlines()[0]) for d in done) < IMPORT_S
    assert "numpy" not in done[0].stdout
    assert "typer" not in done[0].stdout


def test_a_type_checker_finds_the_public_names() -> None:
    from tests.public_stub import STUB, statements, stub

    there = statements(STUB.read_text("utf-8"))
    assert there == statements(stub()), "run python -m tests.public_stub and make check"
    assert sum(" as " in s and s.startswith("from .") for s in there) == len(NAMES)


def test_fly_record_identify_compare_and_report_in_python(tmp_path: Path) -> None:
    device = "mock:?speed=max&seed={}&start=level&hide=motor.lag:0.1"
    train = h3.fly_plan(first_part("multisine", 30.0), device=device.format(1), seed=1)
    test = h3.fly_plan(
        h3.step_plan((5.0, None, 10.0), settle_s=1.0, duration_s=10.0),
        device=device.format(2),
        output=tmp_path / "step.mcap",
    )
    identified = h3.identify(train.recording, holdout=test.recording)
    assert isinstance(identified.model, h3.GreyBoxModel)
    h3.save_model(identified.model, tmp_path / "m.json")
    model = h3.load_model(tmp_path / "m.json", test.recording.profile)
    comparison = h3.compare(
        [h3.load(tmp_path / "step.mcap")], [h3.hover_model(h3.default_profile()), model]
    )
    assert comparison.flights[0].loop == "replayed"
    assert h3.comparison_document(comparison)["schema"] == "heli3dof.comparison/1"
    page = h3.flight_report([test.recording], comparison=comparison)
    assert "step" in page
    flown = h3.simulate(h3.step_plan((5.0, None, None)), model, start="level")
    assert np.isfinite(flown.angle).all()


def test_a_flight_with_too_little_excitation_gives_a_model_with_warnings() -> None:
    flight = h3.fly_plan(h3.step_plan((10.0, None, None)), device="mock:?speed=max&seed=1")
    identified = h3.identify(flight.recording, method="pem", order=6)
    assert any("heli3dof run multisine" in w and "roll" in w for w in identified.warnings)


@pytest.fixture(scope="module")
def short() -> h3.Recording:
    """The first 12 s of a multisine."""
    return h3.fly_plan(first_part("multisine", 12.0), device="mock:?speed=max&seed=1").recording


def test_training_data_is_refused_as_hold_out_data(short: h3.Recording) -> None:
    with pytest.raises(h3.UsageError, match="cannot be used as hold-out data"):
        h3.identify(short, holdout=short, method="pem", order=6)
    with pytest.raises(h3.UsageError, match="cannot be used as hold-out data"):
        h3.diagnose(short, holdout=[short], quick=True)
    with pytest.raises(h3.UsageError, match="given twice"):
        h3.identify([short, short], method="pem", order=6)


def test_a_linear_model_is_simulated_with_the_profile_of_its_rig(tmp_path: Path) -> None:
    data = h3.default_profile().to_dict()
    data["mass"]["m_w"], data["motor"]["V_o"] = 1.7, 9.0
    rig = h3.profile_from_dict(data)
    plan = h3.step_plan(roll=10, settle_s=1.0, duration_s=5.0)
    model = h3.hover_model(rig)
    expected = h3.simulate(plan, model, profile=rig)
    h3.save_model(model, tmp_path / "hover.json")
    for same in (model, h3.load_model(tmp_path / "hover.json"), h3.load_model("hover", rig)):
        assert h3.simulate(plan, same).digest == expected.digest
    flight = h3.fly_plan(
        first_part("multisine", 30.0), device="mock:?speed=max&seed=1", profile=rig
    ).recording
    assert h3.identify(flight, method="pem", order=6).model.profile == flight.profile


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> FakeDriver:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    driver = FakeDriver()
    only_drivers(monkeypatch, fake=driver)
    return driver


def test_open_rig_locks_the_rig_and_closes_it(fake: FakeDriver) -> None:
    profile = h3.default_profile()
    with h3.open_rig("fake://1", profile) as rig:
        assert rig.read().counts == (0, 0, 0)
        assert [s.device for s in running("fake://1")] == ["fake://1"]
        with pytest.raises(h3.DeviceError, match="busy"), h3.open_rig("fake://1", profile):
            pass
    assert running("fake://1") == []
    assert fake.closed == 1


def test_an_open_rig_is_stopped_by_estop_from_python(fake: FakeDriver) -> None:
    with h3.open_rig("fake://1", h3.default_profile()) as rig:
        result = h3.estop("fake://1", "a test")
        assert [s.device for s in result.stopped] == ["fake://1"]
        with pytest.raises(h3.SafetyTrip, match="a test"):
            rig.arm()
    fake.urls = ()
    with pytest.raises(h3.DeviceError, match="No rig was stopped"):
        h3.estop()


def test_zero_stores_the_rest_counts_in_python(
    fake: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("heli3dof.rig.zero.MEASURE_S", 0.05)
    fake.counts = (12, -3, 40)
    dry = h3.zero(store=False)
    assert dry.stored is None
    result = h3.zero()
    assert result.calibration.counts_at_rest == (12, -3, 40)
    assert result.stored is not None
    assert result.stored.exists()
    assert h3.zero().shift_deg == (0.0, 0.0, 0.0)


def test_the_device_variable_chooses_a_rig_to_measure_but_none_to_fly(
    fake: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("heli3dof.rig.zero.MEASURE_S", 0.05)
    monkeypatch.setenv("HELI3DOF_DEVICE", "fake://2")
    assert h3.zero(store=False).device == "fake://2"
    assert h3.doctor().device == "fake://2"
    opened = fake.closed
    with pytest.raises(h3.UsageError, match="mock"):  # the fixture removes the emulated rig
        h3.fly_plan(h3.step_plan((5.0, None, None)))
    assert fake.closed == opened


def test_doctor_returns_its_checks_in_python(tmp_path: Path) -> None:
    report = h3.doctor("mock:", folder=tmp_path)
    assert report.opened
    assert {group for group, _ in report.checks} == {"computer", "recordings", "rig"}
    assert all(check.good is False for check in report.failed)


def test_every_type_hint_of_the_api_can_be_resolved() -> None:
    for name in ("zero", "doctor", "estop"):
        assert "return" in typing.get_type_hints(getattr(h3, name))


FUNCTION_OF = {
    "devices": "find_rigs", "import": "import_log", "info": "file_info", "plans": "named_plans",
    "plot": "flight_figure", "profile": "save_profile", "report": "flight_report",
    "run": "fly_plan", "run-step": "step_plan",
}  # fmt: skip
"""Verb → the public function that does the same, where the name differs"""


def test_the_package_names_every_verb_that_has_no_function() -> None:
    verbs = {str(c.name) for c in (*app.registered_commands, *app.registered_groups)}
    without = {v for v in verbs if FUNCTION_OF.get(v, v) not in NAMES}
    listed = str(h3.__doc__).partition("command line only:")[2].partition(";")[0]
    assert {word.strip() for word in listed.replace("\n", " ").split(",")} == without
    assert set(FUNCTION_OF.values()) <= set(NAMES)
