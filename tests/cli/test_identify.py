"""``identify``, ``compare``, ``report`` and ``demo`` from the command line."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from heli3dof_recordings import references

from heli3dof.cli.demo import FOLDER
from heli3dof.diagnosis import diagnose as diagnosing
from heli3dof.identification.black_box import state_space
from heli3dof.model.greybox.model import nominal
from heli3dof.model.model_file import save_model
from heli3dof.recording.atomic_write import default_output
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.write import write_recording
from heli3dof.rig.profile import default_profile
from tests.cli.running import heli3dof
from tests.flown import first_part
from tests.profiles import profile as profile_at

TRAIN = [r.path for r in references() if r.use == "identify"]
TEST = [r.path for r in references() if r.use == "compare"]


@pytest.fixture
def one_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """The order search of a black box has one candidate, at two sampling intervals."""
    monkeypatch.setattr(state_space, "ORDERS", (8,))


@pytest.fixture(scope="module")
def identified(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    path = tmp_path_factory.mktemp("identify") / "model.json"
    page = path.with_name("identification.html")
    result = heli3dof(
        "identify",
        TRAIN[0],
        "--report",
        page,
        "--holdout",
        TEST[0],
        "--method",
        "pem",
        "--order",
        "8",
        "-o",
        path,
        "--name",
        "ours",
        "--json",
    )
    assert result.code == 0, result.err
    return path, result.document


def test_identify_writes_a_model_and_scores_it_on_held_out_data(identified: tuple) -> None:
    path, document = identified
    (model,) = document["models"]
    assert model["file"] == str(path)
    assert path.exists()
    assert model["kind"] == "statespace"
    assert len(model["poles"]) == 8
    assert all(p["re_std_per_s"] > 0 for p in model["poles"])
    for axis in ("roll", "pitch", "yaw"):
        fit = model["fit_percent"][axis]
        assert set(fit) >= {"one_step", "0.1_s", "0.5_s", "1_s", "closed_loop_replay"}
        assert fit["one_step"] > 90
    assert "step-roll-10" in model["validation"]
    assert model["residual_tests"]
    assert model["feedback"]["present"] is True


def test_the_default_is_the_grey_box_and_its_parameters_have_intervals(tmp_path: Path) -> None:
    path = tmp_path / "grey.json"
    result = heli3dof("identify", *TRAIN, "--holdout", TEST[1], "-o", path, "--json")
    assert result.code == 0, result.err
    stages = [line for line in result.err.splitlines() if line.endswith("…")]
    assert stages[-3:] == [
        "Selecting the rows to fit …",
        "Fitting the model …",
        "Evaluating the model on held-out data …",
    ]
    (model,) = result.document["models"]
    assert model["kind"] == "greybox"
    lag = model["parameters"]["motor.lag.time_constant_s"]
    assert lag["unit"] == "s"
    assert lag["value"] == pytest.approx(0.1, abs=4 * lag["std"])
    assert 0 < lag["cramer_rao_bound"] < 0.01
    assert model["fit_percent"]["pitch"]["closed_loop_replay"] > 90
    result = heli3dof("compare", TEST[1], path, "hover", "-o", tmp_path / "out", "--json")
    assert [m["name"] for m in result.document["flights"][0]["models"]] == ["greybox", "hover"]
    flown = heli3dof("simulate", "steps", "--model", path, "-o", tmp_path / "sim.mcap", "--json")
    assert flown.code == 0, flown.err


def test_a_recording_that_diagnose_calls_bad_data_is_refused(tmp_path: Path) -> None:
    r = read_recording(TRAIN[0])
    per_cent = {n: getattr(r, n) * 100 / 24 for n in ("voltage", "voltage_cmd", "voltage_extra")}
    path = write_recording(replace(r, **per_cent), tmp_path / "per-cent.mcap")
    model = tmp_path / "m.json"
    for words in (("identify", path), ("identify", TRAIN[1], "--holdout", path)):
        result = heli3dof(*words, "-o", model, "--json")
        assert result.code == diagnosed_code(path) == 5
        assert result.document["error"].startswith("Bad data: ")
        assert "per cent of the limit" in result.document["cause"]
    assert not model.exists()


def diagnosed_code(path: Path) -> int:
    """Return the exit code of `heli3dof diagnose`."""
    return heli3dof("diagnose", path, "--quick").code


def test_terms_are_added_and_removed_by_name(tmp_path: Path) -> None:
    words = ("identify", TRAIN[0], "-o", tmp_path / "m.json", "--force", "--json")
    result = heli3dof(*words, "--terms", "+friction.coulomb.yaw,-bias.torque.pitch")
    assert result.code == 0, result.err
    names = result.document["models"][0]["parameters"]
    assert "friction.coulomb.yaw.torque_Nm" in names
    assert "bias.torque.pitch.torque_Nm" not in names
    for wrong, hint in (("+friction.colomb.yaw", "friction.coulomb"), ("-motor.dela", "motor.lag")):
        result = heli3dof(*words, "--terms", wrong)
        assert result.code == 2
        assert hint in result.err
    refused = heli3dof(*words, "--order", "8")
    assert refused.code == 2
    assert refused.document["fix"] == "--method pem, or leave order out"
    assert "Try: --method pem, or" in refused.err
    assert heli3dof(*words, "--method", "pem", "--terms", "motor.lag").code == 2


def test_the_identification_report_shows_bands_and_residuals(identified: tuple) -> None:
    text = identified[0].with_name("identification.html").read_text(encoding="utf-8")
    for words in ("Poles, continuous time", "Residual tests", "Bode diagrams", "Innovations"):
        assert words in text
    assert text.count("<figure") >= 6  # the flight, three angles, Bode twice, innovations


def test_compare_gives_every_metric_and_its_difference(identified: tuple, tmp_path: Path) -> None:
    path, _ = identified
    result = heli3dof("compare", *TEST, "hover", path, "-o", tmp_path / "out", "--json")
    assert result.code == 0, result.err
    document = result.document
    assert [f["recording"] for f in document["flights"]] == [p.stem for p in TEST]
    for flight in document["flights"]:
        assert flight["loop"] == "replayed"
        assert [m["name"] for m in flight["models"]] == ["hover", "ours"]
        for model in flight["models"]:
            for axis in ("roll", "pitch", "yaw"):
                results, experiment = model["axes"][axis], flight["experiment"][axis]
                for key in ("peak_deg", "overshoot_deg", "steady_error_deg", "rise_time_s"):
                    assert key in results
                    assert key in results["difference"]
                peak = results["peak_deg"] - experiment["peak_deg"]
                assert math.isclose(results["difference"]["peak_deg"], peak, abs_tol=1e-9)
    written = {Path(f).name for f in document["figures"]}
    assert len(written) == 2 * 3 * 2
    assert all((tmp_path / "out" / name).stat().st_size > 2000 for name in written)


@pytest.mark.usefixtures("one_order")
def test_compare_without_arguments_uses_the_supplied_recordings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = heli3dof("compare")
    assert result.code == 0, result.err
    for words in ("Table II", "black box", "grey box", "hover", "never published"):
        assert words in result.out
    assert len(list(tmp_path.glob("comparisons/*/*.svg"))) == 6


def test_a_log_without_its_controller_is_replayed_on_request(tmp_path: Path) -> None:
    log, profile = tmp_path / "log.csv", tmp_path / "rig.toml"
    assert heli3dof("export", TEST[0], "-o", log).code == 0
    known, _, _ = (
        (TEST[0].parent / "rig.toml").read_text(encoding="utf-8").partition("[controller]")
    )
    profile.write_text(known, encoding="utf-8")
    words = ("compare", log, "hover", "--profile", profile, "-o", tmp_path / "figures")
    plain = heli3dof(*words)
    assert "not replayed: the controller is unknown" in plain.err
    assert "add --identify-controller" in plain.err
    replayed = heli3dof(*words, "--identify-controller", "--force")
    assert "closed-loop replay, controller identified from the log" in replayed.out


def test_a_model_with_a_typing_error_is_no_missing_recording() -> None:
    result = heli3dof("compare", TEST[0], "hoover")
    assert result.code == 2
    assert "did you mean 'hover'?" in result.err


def test_models_without_recordings_are_refused() -> None:
    result = heli3dof("compare", "hover")
    assert result.code == 2
    assert "no recording" in result.err


def test_a_report_is_one_self_contained_file(identified: tuple, tmp_path: Path) -> None:
    path, _ = identified
    page = tmp_path / "r.html"
    result = heli3dof("report", TEST[1], "--model", "hover", "--model", path, "-o", page)
    assert result.code == 0, result.err
    text = page.read_text(encoding="utf-8")
    assert "step-yaw-20" in text
    assert "ours" in text
    for outside in ('src="http', 'href="http', "<script src", "@import", "url(http"):
        assert outside not in text
    assert heli3dof("report", TEST[1], "-o", page).code == 2


def test_models_of_one_name_are_labelled_by_their_files(tmp_path: Path) -> None:
    fast, slow = (tmp_path / f"{stem}.json" for stem in ("fast", "slow"))
    for path, lag_s in ((fast, 0.01), (slow, 0.1)):
        lag = {"motor.lag.time_constant_s": lag_s}
        save_model(nominal(default_profile(), ("motor.lag",), **lag), path)
    page = tmp_path / "r.html"
    assert heli3dof("report", TEST[0], "--model", fast, "--model", slow, "-o", page).code == 0
    results = tmp_path / "out"
    words = ("compare", TEST[0], "--model", fast, "--model", slow, "-o", results, "--workers", 1)
    assert heli3dof("batch", *words).code == 0
    head = (results / "results.csv").read_text(encoding="utf-8").splitlines()[0]
    for label in ("fast", "slow"):
        assert f"Parameters of {label}<" in page.read_text(encoding="utf-8")
        assert f"{label}_rmse_1_yaw_deg" in head


@pytest.mark.usefixtures("one_order")
def test_the_demo_does_the_whole_chain_and_keeps_an_earlier_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    at_250_hz = profile_at(rate_hz=250.0)
    monkeypatch.setattr(diagnosing, "QUICK", diagnosing.Effort(6, 8, 3, 6))
    monkeypatch.setattr("heli3dof.experiment.plan.load_plan", lambda name: first_part(name, 28.0))
    monkeypatch.setattr("heli3dof.rig.profile.default_profile", lambda: at_250_hz)
    result = heli3dof("demo", "--json")
    assert result.code == 0, result.err
    document = json.loads(result.out)
    assert Path(document["report"]).stat().st_size > 100_000
    named = [
        ".".join(filter(None, (f["effect"], f["axis"]))) for f in document["diagnosis"]["findings"]
    ]
    assert sorted(named) == sorted(h.partition(":")[0] for h in document["hidden"].split(","))
    for made in (*document["recordings"], *document["models"]):
        assert Path(made).exists()
    (tmp_path / "heli3dof-demo" / "mine.txt").write_text("kept")
    assert default_output(FOLDER, force=False).name == "heli3dof-demo-2"
    assert (tmp_path / "heli3dof-demo" / "mine.txt").read_text() == "kept"
