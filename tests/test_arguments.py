"""The arguments of the public functions: names, paths, single objects, and clear refusals."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import heli3dof as h3
from tests.flown import first_part
from tests.recording.make import changed

PLAN = h3.step_plan(roll=5, settle_s=1.0, duration_s=5.0)
HOVER = h3.hover_model(h3.default_profile())


@pytest.fixture(scope="module")
def flown() -> h3.Recording:
    return h3.fly_plan(PLAN, device="mock:?speed=max&seed=1").recording


def test_a_plan_is_taken_by_name_or_path(tmp_path: Path) -> None:
    file = tmp_path / "short.toml"
    file.write_text('name = "short"\n[[segment]]\nkind = "step"\nroll_deg = 5\nduration_s = 2\n')
    assert h3.simulate(str(file), "hover").name == "short-on-hover"
    assert h3.fly_plan(file).recording.meta["plan"]["name"] == "short"
    with pytest.raises(h3.PlanError, match="no plan ritch"):
        h3.fly_plan("ritch")


def test_a_profile_is_taken_by_path(flown: h3.Recording, tmp_path: Path) -> None:
    data = {**h3.default_profile().to_dict(), "name": "mine"}
    path = tmp_path / "rig.toml"
    path.write_text(text_of(data))
    h3.write_recording(flown, tmp_path / "a.mcap")
    assert h3.load(tmp_path / "a.mcap", path).profile.name == "mine"
    assert h3.fly_plan(PLAN, profile=str(path)).recording.profile.name == "mine"
    assert h3.simulate(PLAN, "hover", profile=path).profile.name == "mine"
    with h3.open_rig("mock:", path) as rig:
        assert rig.identity.driver
    with pytest.raises(h3.ProfileError, match="There is no profile"):
        h3.fly_plan(PLAN, profile=tmp_path / "none.toml")


def text_of(data: dict[str, Any]) -> str:
    lines = [f'name = "{data["name"]}"']
    for section in ("geometry", "mass", "motor", "encoder", "loop"):
        lines += [f"[{section}]", *(f"{k} = {v}" for k, v in data[section].items())]
    return "\n".join([*lines, "[controller]"])


def test_recordings_and_models_are_taken_alone_and_by_name(
    flown: h3.Recording, tmp_path: Path
) -> None:
    path = h3.write_recording(flown, tmp_path / "a.mcap")
    listed = h3.comparison_document(h3.compare([flown], [HOVER], horizons_s=[0.5]))
    for recordings, models in ((flown, HOVER), ([flown], "hover"), (flown, ["hover"])):
        alone = h3.compare(recordings, models, horizons_s=0.5)
        assert h3.comparison_document(alone) == listed
    assert h3.compare(str(path), ["hover", HOVER]).flights[0].recording.digest == flown.digest
    assert "step-roll-5" in h3.flight_report(flown, models="hover")
    with pytest.raises(h3.RecordingError, match="There is no recording"):
        h3.identify(tmp_path / "none.mcap")


def test_a_model_by_name_is_of_each_recordings_rig(flown: h3.Recording) -> None:
    data = h3.default_profile().to_dict()
    data["motor"]["V_o"] = 9.0
    other = h3.simulate(PLAN, "hover", profile=h3.profile_from_dict(data))
    by_name = h3.compare([flown, other], "hover", horizons_s=()).flights[1]
    own = h3.compare(other, h3.hover_model(other.profile), horizons_s=()).flights[0]
    np.testing.assert_array_equal(by_name.models[0].replay_rmse_deg, own.models[0].replay_rmse_deg)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: h3.simulate(PLAN, HOVER, start="foo"), "no start 'foo'"),
        (lambda r: h3.compare([r], [HOVER], horizons_s=[-1]), "horizons_s is"),
        (lambda r: h3.identify(r, method="pem", intervals_s=(-0.04,)), "intervals_s is"),
        (lambda r: h3.hover_model(h3.default_profile(), dt=0), "dt is 0"),
        (lambda r: h3.import_log("a.csv", None, rate_hz=0), "rate_hz is 0"),
        (lambda r: h3.step_plan(roll=10, settle_s=-1), "duration_s = -1.0"),
        (lambda r: h3.step_plan(10), "target_deg is 10"),
        (lambda r: h3.step_plan((10, 5)), "target_deg is .* three angles"),
        (lambda r: h3.step_plan((10, None, None), roll=5), "two angles for roll"),
        (lambda r: h3.zero("mock:", angles_deg=(0, 0)), "angles_deg is .* three angles"),
        (lambda r: h3.fly_plan(PLAN, seed=-1), "seed is -1, not a whole number"),
        (lambda r: h3.diagnose(r, seed=-1), "seed is -1, not a whole number"),
        (lambda r: h3.simulate(PLAN, HOVER, seed=1.5), "seed is 1.5, not a whole"),
        (lambda r: h3.fly_plan(3), "plan is 3, not a plan"),
        (lambda r: h3.load("a.csv", 3), "profile is 3, not a profile"),
        (lambda r: h3.diagnose([]), "No recording was given"),
        (lambda r: h3.identify([r, HOVER]), r"recordings\[1\] is of the type LinearModel"),
        (lambda r: h3.compare(r, [r]), r"models\[0\] is of the type Recording"),
        (lambda r: h3.compare(r, ["hoover"]), "no model file hoover"),
        (lambda r: h3.compare([r], []), "No model was given"),
        (lambda r: h3.identify(r, order=8), "Try: method='pem', or leave order out"),
        (lambda r: h3.identify(r, method="pem", order=0), "^order 0 is not possible"),
        (lambda r: h3.identify(r, method="arx"), "Try: one of freeflight, greybox"),
        (lambda r: h3.flight_metrics(r.between(100, 200)), "has no samples"),
        (lambda r: r.has_reference("elevation"), "no axis 'elevation'"),
        (lambda r: setattr(r.profile.mass, "m_w", 2), "m_w of a Mass cannot be set"),
    ],
)
def test_a_wrong_argument_is_named(
    flown: h3.Recording, call: Callable[[h3.Recording], Any], message: str
) -> None:
    with pytest.raises(h3.Heli3dofError, match=message) as caught:
        call(flown)
    assert caught.value.cause
    assert caught.value.fix
    assert " --" not in str(caught.value).partition("heli3dof ")[0]


def test_a_model_refuses_an_interval_or_a_horizon_of_zero(flown: h3.Recording) -> None:
    from tests.model.test_greybox_model import true_model

    for model in (true_model(), h3.hover_model(h3.default_profile())):
        with pytest.raises(h3.UsageError, match="dt is 0"):
            model.to_control(dt=0)
        for horizon_s in (0.0, -1.0):
            with pytest.raises(h3.UsageError, match=f"horizon_s is {horizon_s}"):
                model.predict(flown, horizon_s)


def test_recordings_of_two_rigs_are_not_fitted_together(flown: h3.Recording) -> None:
    data = h3.default_profile().to_dict()
    data["geometry"]["L_a"] = 0.5
    other = replace(flown, profile=h3.profile_from_dict(data))
    for fit in (h3.identify, h3.diagnose):
        for arguments in (([flown, other],), (flown, other)):
            given = dict(zip(("recordings", "holdout"), arguments, strict=False))
            with pytest.raises(h3.UsageError, match=r"another rig than .*L_a = 0\.5 and 0\.66"):
                fit(**given)


def test_recordings_of_two_serial_numbers_are_not_fitted_together(flown: h3.Recording) -> None:
    one, other, emulated = (
        replace(flown, meta={"identity": {"serial": s}}) for s in ("ex-1", "ex-2", "mock-3")
    )
    for fit in (h3.identify, h3.diagnose):
        with pytest.raises(h3.UsageError, match=r"another rig .*: serial numbers ex-2 and ex-1"):
            fit([one, emulated], holdout=other)


def test_the_file_of_a_model_in_a_document_is_no_model(flown: h3.Recording) -> None:
    found = h3.diagnose(first_part_of_a_still_rig(), quick=True)
    assert h3.diagnosis_document(found, model_file="m.json")["model"] == "m.json"


def first_part_of_a_still_rig() -> h3.Recording:
    flight = h3.fly_plan(first_part("multisine", 3.0), device="mock:?speed=max&seed=1").recording
    return changed(flight, "angle", slice(None), flight.angle[0])


def test_public_functions_can_be_pickled_and_keep_their_names() -> None:
    assert pickle.loads(pickle.dumps(h3.fly_plan)) is h3.fly_plan
    assert h3.fly_plan.__name__ == "fly_plan"


def test_export_takes_the_path_of_a_recording_or_model(flown: h3.Recording, tmp_path: Path) -> None:
    h3.write_recording(flown, tmp_path / "a.mcap")
    h3.save_model(HOVER, tmp_path / "m.json")
    assert h3.export(tmp_path / "a.mcap", tmp_path / "a.csv").is_file()
    assert h3.export(str(tmp_path / "m.json"), tmp_path / "m.mat").is_file()
    for other in (flown.profile, PLAN, None):
        with pytest.raises(h3.UsageError, match="not a recording or a model"):
            h3.export(other, tmp_path / "b.mat")  # type: ignore[arg-type]


def test_a_profile_without_controller_has_no_loop_to_check() -> None:
    with pytest.raises(h3.UsageError, match="controller is None"):
        h3.check_loop(HOVER, None, 0.002)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: h3.fly_plan(PLAN, device=None), "device is None, not a text"),
        (lambda r: h3.fly_plan(PLAN, output=3), "output is 3, not a path"),
        (lambda r: h3.fly_plan(PLAN, meta="x"), "meta is 'x', not a dict"),
        (lambda r: h3.fly_plan(PLAN, meta={3: 4}), "not a dict whose keys are texts"),
        (lambda r: h3.fly_plan(PLAN, meta={"seed": 9}), "meta has the key 'seed'"),
        (lambda r: h3.step_plan(roll="a"), "roll is 'a', not a finite number"),
        (lambda r: h3.step_plan(roll=[1.0, 2.0]), "not a finite number"),
        (lambda r: h3.identify(r, method=None), "method is None, not a text"),
        (lambda r: h3.identify(r, method="pem", order=2.5), "order is 2.5, not a whole number"),
        (lambda r: h3.identify(r, terms=3), "terms is 3, not a text"),
        (lambda r: h3.identify(r, method="pem", intervals_s=[]), "intervals_s is empty"),
        (lambda r: h3.diagnose(r, base=None), "base is None"),
        (lambda r: h3.diagnose(r, progress=None), "progress is None, not a function"),
        (lambda r: HOVER.predict(r, "a"), "horizon_s is a; it must be positive"),
        (lambda r: HOVER.predict(r, None), "horizon_s is None; it must be positive"),
        (lambda r: h3.load(None), "path is None, not a path"),
        (lambda r: h3.load(b"a.mcap"), "path is b'a.mcap', not a path"),
        (lambda r: h3.load_model(r), "name_or_path is of the type Recording"),
        (lambda r: h3.load_plan(3), "name_or_path is 3"),
        (lambda r: h3.load_profile(3), "path is 3"),
        (lambda r: h3.import_log([3], r.profile), "paths is 3, not a path"),
        (lambda r: h3.import_log([], r.profile), "No log was given"),
        (lambda r: h3.import_log(iter(()), r.profile), "No log was given"),
        (lambda r: h3.import_log("a.csv", r.profile, mapping="roll_deg=x"), "mapping is 'roll_deg"),
        (lambda r: h3.import_log("a.csv", r.profile, mapping={"roll_deg": 3}), "mapping is {"),
        (lambda r: h3.load("a.csv", r.profile, columns=3), "columns is 3, not a text"),
        (lambda r: h3.compare(r, HOVER, horizons_s="1"), "horizons_s is '1'; it must be"),
        (lambda r: h3.identify(r, name=3), "name is 3, not a text"),
        (lambda r: h3.flight_report(r, identified=HOVER), "not an identification"),
        (lambda r: h3.flight_report(r, diagnosed={"schema": "x"}), "not a diagnosis"),
        (lambda r: h3.save_profile(r.profile, 3), "path is 3"),
        (lambda r: r.profile.with_gain("a"), "no finite numbers"),
        (lambda r: h3.hover_model(None), "profile is None, not a profile"),
        (lambda r: h3.next_experiment(None), "found is None, not a diagnosis"),
        (lambda r: h3.comparison_document(None), "comparison is None, not a comparison"),
        (lambda r: h3.comparison_figures(None), "comparison is None, not a comparison"),
        (lambda r: h3.diagnosis_document(None), "d is None, not a diagnosis"),
        (lambda r: h3.diagnosis_summary({}), "document is {}, not the JSON document"),
        (lambda r: h3.recover(None), "path is None"),
        (lambda r: h3.estop(3), "device is 3, not a text"),
        (lambda r: h3.zero("mock:", angles_deg=(float("nan"), 0, 0)), "three angles in degrees"),
        (lambda r: h3.run_auto(device="mock:", folder="x", budget_min="a"), "budget_min is 'a'"),
    ],
)
def test_a_wrong_value_is_a_usage_error(
    flown: h3.Recording, call: Callable[[h3.Recording], Any], message: str
) -> None:
    with pytest.raises(h3.UsageError, match=message) as caught:
        call(flown)
    assert caught.value.cause
    assert caught.value.fix


def test_several_paths_may_come_from_a_generator() -> None:
    with pytest.raises(h3.RecordingError, match="There is no recording none"):
        h3.import_log((name for name in ("none.csv",)), h3.default_profile())


def test_a_linearisation_needs_a_positive_interval() -> None:
    from tests.model.test_greybox_model import true_model

    for dt in (0, float("nan")):
        with pytest.raises(h3.UsageError, match="dt is "):
            true_model().linear(dt)


def test_a_model_of_another_rig_gives_a_warning(flown: h3.Recording) -> None:
    data = h3.default_profile().to_dict()
    data["mass"]["m_w"] = 1.7
    other = h3.profile_from_dict(data)
    says = "another rig than the .*mass.m_w = 1.87 and 1.7 in their profiles"
    (warning,) = h3.simulate(PLAN, HOVER, profile=other).meta["warnings"]
    assert re.search(says, warning)
    assert "warnings" not in h3.simulate(PLAN, HOVER).meta
    comparison = h3.compare(replace(flown, profile=other), [HOVER, "hover"], horizons_s=[1.0])
    assert len([w for w in comparison.warnings if re.search(says, w)]) == 1


def test_a_profile_is_not_written_under_another_formats_ending(tmp_path: Path) -> None:
    for name in ("rig.json", "rig.csv", "rig.mcap"):
        with pytest.raises(h3.UsageError, match=r"would be a \.toml file") as caught:
            h3.save_profile(h3.default_profile(), tmp_path / name)
        assert "export" not in caught.value.fix
