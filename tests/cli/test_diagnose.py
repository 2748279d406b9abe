"""``diagnose`` from the command line: the document, the model file, exit codes. Seeds from 1200."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from heli3dof.cli.inputs import load_all
from heli3dof.cli.output import Output
from heli3dof.diagnosis import diagnose as module
from heli3dof.experiment.plan import step_plan
from heli3dof.paper.models import load_model
from heli3dof.recording.logs.export import export
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.provenance import rig_to_fly
from heli3dof.recording.write import write_recording
from heli3dof.rig.profile import default_profile
from tests.cli.running import Result, heli3dof
from tests.flown import flown
from tests.profiles import profile

RIG = Path(__file__).parents[2] / "recordings" / "rig.toml"
KEYS = {
    "schema", "recordings", "holdout", "verdict", "simulation_error", "calibration", "findings",
    "not_identifiable", "leftover", "next_experiment", "gain", "model",
}  # fmt: skip
AXES = {"roll", "pitch", "yaw"}


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty seconds of the rich plan, at 250 Hz, on a rig with a cable, 7 % off its profile."""
    device = "mock:?speed=max&hide=stiffness.cable.yaw:0.1&seed=1101&spread=0.07"
    cut = flown("rich", 40.0, device=device, seed=1101, profile=profile(rate_hz=250.0))
    path = tmp_path_factory.mktemp("diagnose") / "cable.mcap"
    write_recording(replace(cut, meta={**cut.meta, "name": "cable"}), path)
    return path


@pytest.fixture(scope="module")
def result(flight: Path) -> Result:
    with pytest.MonkeyPatch.context() as few:
        few.setattr(module, "QUICK", module.QUICK._replace(nulls=8, correction=4))
        model = flight.with_name("extended.json")
        page = ("--report", flight.with_name("page.html"))
        return heli3dof("diagnose", flight, "--quick", "-o", model, *page, "--json", "--seed", "3")


def numbers(value: Any) -> list[float]:
    if isinstance(value, dict):
        return [n for v in value.values() for n in numbers(v)]
    if isinstance(value, list):
        return [n for v in value for n in numbers(v)]
    return [value] if isinstance(value, float) else []


def test_the_document_holds_every_key_of_the_contract(result: Result) -> None:
    assert result.code == 0, result.err
    d = result.document
    assert set(d) >= KEYS
    assert d["schema"] == "heli3dof.diagnosis/1"
    assert d["recordings"] == ["cable"]
    assert d["holdout"] == []
    assert set(d["simulation_error"]) == AXES
    assert all(set(e) >= {"rmse_deg", "noise_floor_deg", "horizon_s"}
               for e in d["simulation_error"].values())  # fmt: skip
    for c in d["calibration"]:
        assert set(c) >= {"parameter", "nominal", "value", "std", "unit"}
    rmse = d["gain"]["holdout_rmse_deg"]
    assert set(rmse) >= {"before", "after", "noise_floor"}
    assert all(set(side) == AXES for side in rmse.values())
    assert all(math.isfinite(n) for n in numbers(d))
    assert set(d["about"]["seconds"]) >= {"base", "screen 1", "fits 1", "gain"}


def test_the_cable_is_named_with_its_size_and_the_gain_is_measured(result: Result) -> None:
    (finding,) = result.document["findings"]
    assert (finding["effect"], finding["axis"]) == ("stiffness.cable", "yaw")
    size = finding["parameters"]["stiffness_Nm_per_rad"]
    assert abs(size["value"] - 0.1) < max(4 * size["std"], 0.005)
    assert set(finding) >= {"score", "confidence", "tied_with", "gain"}
    gain = finding["gain"]["holdout_rmse_deg"]
    assert gain["after"]["yaw"] < 0.25 * gain["before"]["yaw"]
    assert finding["gain"]["holdout_log_likelihood_interval"][0] > 50
    assert result.document["verdict"] == "explained"
    for words in ("Simulation error", "Cause 1: stiffness.cable.yaw", "RMSE on blocks left out"):
        assert words in result.err
    assert "Screening against 8 null simulations …\n" in result.err
    assert "Candidate: stiffness.cable.yaw.\n" in result.err
    assert result.err.count("Measuring the gain on held-out data …\n") == 1
    assert "nulls … " not in result.err  # how far it has come is for terminals


def test_the_next_flight_of_an_emulated_rig_has_another_seed() -> None:
    def flown_on(*urls: str) -> dict[str, str]:
        return rig_to_fly([replace(r, meta={"device": url}) for url in urls])

    r = flown("steps", 3.0, device="mock:?speed=max")
    assert flown_on("mock:?speed=max&seed=13") == {"device": "mock:?speed=max&seed=14"}
    assert flown_on("mock:?seed=13", "mock:?seed=15") == {"device": "mock:?seed=16"}
    assert flown_on("mock:?seed=13", "mock:?seed=15&start=level") == {}
    assert flown_on("serial:///dev/ttyACM0") == {"device": "serial:///dev/ttyACM0"}
    assert rig_to_fly([replace(r, meta={})]) == {}


def test_the_next_flight_has_the_profile_of_the_recordings(tmp_path: Path) -> None:
    r = flown("steps", 3.0, device="mock:?speed=max")
    landing = r.profile.limits.model_copy(update={"landing_s": 0.5})
    older = replace(r, profile=r.profile.model_copy(update={"limits": landing}), meta={})
    assert rig_to_fly([older]) == {}
    other = replace(r, profile=r.profile.model_copy(update={"name": "lab"}), meta={})
    assert rig_to_fly([other]) == {"profile": "PROFILE.toml"}
    log, file = export(other, tmp_path / "log.csv"), tmp_path / "lab.toml"
    file.write_text(RIG.read_text("utf-8").replace("table-1", "lab"), "utf-8")
    (loaded,) = load_all(Output(quiet=True), [log], file)
    assert rig_to_fly([loaded]) == {"profile": str(file)}
    recording = write_recording(other, tmp_path / "lab.mcap")
    loaded_recordings = load_all(Output(quiet=True), [recording, recording], None)
    assert rig_to_fly(loaded_recordings) == {"profile": str(recording)}
    done = heli3dof("run", "rich", "--dry-run", "--profile", recording)
    assert done.code == 0, done.err


def test_the_page_holds_the_picture_of_the_cable_and_links_nowhere(
    result: Result, flight: Path
) -> None:
    page = flight.with_name("page.html").read_text(encoding="utf-8")
    assert 'alt="Residual yaw torque against yaw, with stiffness.cable.yaw as fitted"' in page
    assert "The worst stretch of yaw" in page
    assert "Table II before and after" in page
    assert 'src="http' not in page
    assert 'href="http' not in page


def test_training_data_is_refused_as_hold_out_data(flight: Path, tmp_path: Path) -> None:
    copy = tmp_path / "another.mcap"
    copy.write_bytes(flight.read_bytes())
    both = heli3dof("diagnose", flight, "--holdout", copy, "-o", tmp_path / "m.json")
    assert both.code == 2
    assert "cannot be used as hold-out data" in both.err
    twice = heli3dof("diagnose", flight, copy, "-o", tmp_path / "m.json")
    assert twice.code == 2
    assert "given twice" in twice.err


def test_a_model_file_among_the_recordings_is_named_as_such(result: Result, tmp_path: Path) -> None:
    model = result.document["model"]
    wrong = heli3dof("diagnose", model, "-o", tmp_path / "m.json")
    assert wrong.code == 5
    assert "model file" in wrong.err
    assert "heli3dof compare" in wrong.err


def test_the_extended_model_is_a_model_file_and_is_never_overwritten(
    result: Result, flight: Path
) -> None:
    path = Path(result.document["model"])
    model = load_model(path, default_profile())
    assert "stiffness.cable.yaw" in model.terms  # type: ignore[attr-defined]
    before = path.read_bytes()
    again = heli3dof("diagnose", flight, "-o", path)
    assert again.code == 2
    assert "exists" in again.err
    assert path.read_bytes() == before


def test_the_same_diagnosis_again_writes_no_second_model(
    flight: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(module, "QUICK", module.QUICK._replace(nulls=2, correction=2))
    whole = module.diagnose

    def first_part(recordings: Any, *args: Any, **options: Any) -> module.Diagnosis:
        return whole([r.between(0.0, 20.0) for r in recordings], *args, **options)

    monkeypatch.setattr(module, "diagnose", first_part)
    for _ in range(2):
        assert heli3dof("diagnose", flight, "--quick", "--quiet").code == 0
    assert [p.name for p in Path().iterdir()] == ["cable-extended.json"]


def test_a_bad_recording_is_printed_and_exits_with_5(
    flight: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "QUICK", module.QUICK._replace(nulls=2))
    whole = module.diagnose

    def at_fault(*args: Any, holdout: Any = None, **options: Any) -> module.Diagnosis:
        (given,) = args[0]
        return replace(whole(given.between(0.0, 14.0), **options), verdict="bad_data")

    monkeypatch.setattr(module, "diagnose", at_fault)
    bad = heli3dof("diagnose", flight, "--quick", "-o", tmp_path / "m.json", "--json")
    assert bad.code == 5
    assert bad.document["verdict"] == "bad_data"
    assert "recording itself is faulty" in bad.err


def test_a_log_in_the_wrong_unit_is_bad_data_and_not_an_error(flight: Path, tmp_path: Path) -> None:
    r = read_recording(flight)
    columns = np.column_stack([r.t, r.voltage, r.angle])
    log = tmp_path / "log.csv"
    names = "t_s,v_front_V,v_back_V,roll_deg,pitch_deg,yaw_deg"
    np.savetxt(log, columns, delimiter=",", fmt="%.9g", header=names, comments="")
    bad = heli3dof("diagnose", log, "--profile", RIG, "-o", tmp_path / "m.json", "--json")
    assert bad.code == 5
    assert set(bad.document) >= KEYS
    assert (bad.document["verdict"], bad.document["recordings"]) == ("bad_data", ["log"])
    (fault,) = bad.document["integrity"]
    assert "radians" in fault["cause"]
    assert "roll_rad" in fault["fix"]
    assert "Verdict: bad data" in bad.err
    quiet = heli3dof("diagnose", log, "--profile", RIG, "-o", tmp_path / "m.json", "--quiet")
    assert fault["fix"] in quiet.err


def test_swapped_columns_that_look_like_a_wrong_unit_are_named(
    tmp_path: Path,
) -> None:
    r = flown(step_plan((10.0, None, None)), device="mock:?speed=max", seed=1202)
    roll, pitch, yaw = np.degrees(r.angle).T
    log = tmp_path / "log.csv"
    # Roll and yaw: what then is called roll moves 1/20 as far as its voltages explain.
    columns = np.column_stack([r.t, r.voltage, yaw, pitch, roll])
    names = "t_s,v_front_V,v_back_V,roll_deg,pitch_deg,yaw_deg"
    np.savetxt(log, columns, delimiter=",", fmt="%.9g", header=names, comments="")
    bad = heli3dof("diagnose", log, "--profile", RIG, "-o", tmp_path / "m.json", "--json")
    assert bad.code == 5
    (fault,) = bad.document["integrity"]
    assert fault["check"] == "columns.swapped"
    assert "roll_deg and yaw_deg" in fault["fix"]
    result = heli3dof("info", log, "--profile", RIG)
    assert "heli3dof diagnose finds" in result.err


def test_missing_recordings_and_logs_without_a_profile_are_refused(tmp_path: Path) -> None:
    missing = heli3dof("diagnose", tmp_path / "none.mcap", "--json")
    assert missing.code == 5
    assert missing.document["exit_code"] == 5
    log = tmp_path / "log.csv"
    log.write_text("t_s,v_front_V,v_back_V,roll_deg\n0,0,0,0\n0.002,0,0,0\n")
    assert heli3dof("diagnose", log).code == 2
    assert heli3dof("diagnose", "x.mcap", "--base", "square").code == 2
