"""``profile new, show, check, update`` and ``plans``: write, check and correct profiles."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from heli3dof.cli import profile_questions as module
from heli3dof.diagnosis import diagnose
from heli3dof.experiment.plan import named_plans
from heli3dof.rig.profile import TABLE_I, default_profile, load_profile
from heli3dof.rig.profile_file import HOVER_REMARK, merged, new_text
from tests.cli.running import Result, heli3dof
from tests.flown import first_part

NUMBERS = {
    f"{section}.{key}": value
    for section, keys in TABLE_I.items()
    if isinstance(keys, dict)
    for key, value in keys.items()
    if key != "V_o"
}


def sets(**changes: object) -> list[object]:
    """``--set`` for every number of Table I but V_o, with changes (``geometry__L_a=…``)."""
    numbers = NUMBERS | {k.replace("__", "."): v for k, v in changes.items()}
    return [word for k, v in numbers.items() for word in ("--set", f"{k}={v}")]


def write(path: Path, **changes: dict[str, Any]) -> Path:
    path.write_text(new_text(merged(TABLE_I, changes)), encoding="utf-8")
    return path


def test_the_papers_numbers_give_the_papers_profile(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    result = heli3dof("profile", "new", *sets(), "-o", path, "--json")
    assert result.code == 0, result.err
    profile = load_profile(path)
    assert profile.motor.V_o == 7.456
    assert profile.controller == default_profile().controller
    assert "its size from the masses, its sign from the rest angle" in result.err
    assert "the masses give" not in result.err
    assert result.document["loop"]["stable"] is True
    assert result.document["loop"]["disc_margin"] == pytest.approx(0.81, abs=0.01)


def test_a_computed_hover_voltage_follows_the_numbers_and_a_measured_one_stays(
    tmp_path: Path,
) -> None:
    computed, new = tmp_path / "computed.toml", ("profile", "new", "--force", "--no-controller")
    assert heli3dof(*new, *sets(), "-o", computed).code == 0

    def copy_of(path: Path, *words: str) -> tuple[float, bool]:
        copy = tmp_path / "copy.toml"
        assert heli3dof(*new, "--from", path, "-o", copy, *words).code == 0
        return load_profile(copy).motor.V_o, HOVER_REMARK in copy.read_text()

    assert copy_of(computed) == (7.456, True)
    K_f = load_profile(computed).motor.K_f
    assert copy_of(computed, "--set", f"motor.K_f={K_f / 2}") == (pytest.approx(14.91), True)
    assert copy_of(computed, "--set", "motor.V_o=7") == (7.0, False)
    measured, kept = tmp_path / "measured.toml", tmp_path / "kept.toml"
    text = computed.read_text().replace("V_o = 7.456", "V_o = 7.1")
    kept.write_text(text)
    measured.write_text(text.replace(f"# {HOVER_REMARK}\n", ""))
    assert copy_of(measured, "--set", f"motor.K_f={K_f / 2}") == (7.1, False)
    assert copy_of(kept, "--set", f"motor.K_f={K_f / 2}") == (7.1, True)


def test_a_gain_is_designed_for_a_rig_of_another_size(tmp_path: Path) -> None:
    path = tmp_path / "small.toml"
    small = sets(geometry__L_a=0.33, geometry__L_w=0.25, mass__m_w=0.5, mass__m_f=0.25,
                 mass__m_b=0.25, motor__v_max=12, motor__V_o=5)  # fmt: skip
    result = heli3dof("profile", "new", *small, "-o", path)
    assert result.code == 0, result.err
    assert "designed for this rig by LQR" in result.err
    K = tomllib.loads(path.read_text())["controller"]["K"]
    assert K[0][6] == pytest.approx(5.0)
    assert heli3dof("profile", "check", path).code == 0


def test_an_existing_file_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text("mine")
    assert heli3dof("profile", "new", *sets(), "-o", path).code == 2
    assert path.read_text() == "mine"
    assert heli3dof("profile", "new", *sets(), "-o", path, "--force").code == 0


def test_without_a_terminal_all_missing_numbers_are_named(tmp_path: Path) -> None:
    result = heli3dof("profile", "new", "-o", tmp_path / "rig.toml")
    assert result.code == 2
    assert all(name in result.err for name in NUMBERS)
    assert not (tmp_path / "rig.toml").exists()


def test_questions_are_repeated_until_the_answer_is_plausible(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = iter(
        ["lab 3", "0.47", "66", "0.66", "abc", "0.178", "1.87", "0.7", "0.7", "0.12", "", "24",
         "-4096", "4096.5", "4096", "8192", "-26", "500"]
    )  # fmt: skip
    monkeypatch.setattr(module, "_is_terminal", lambda: True)
    monkeypatch.setattr(module.typer, "prompt", lambda *a, **k: next(answers))
    result = heli3dof("profile", "new", "-o", tmp_path / "rig.toml")
    assert result.code == 0, result.err
    assert "in centimetres? 66 centimetres are 0.66 m" in result.err
    assert "'abc' is not a number" in result.err
    assert "'4096.5' is not a whole number" in result.err
    profile = load_profile(tmp_path / "rig.toml")
    assert (profile.name, profile.geometry.L_a, profile.encoder.roll) == ("lab 3", 0.66, -4096)
    assert profile.encoder.roll_rest_deg == -26.0


def test_ctrl_c_in_a_question_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def abort(*args: object, **more: object) -> str:
        raise module.typer.Abort

    monkeypatch.setattr(module, "_is_terminal", lambda: True)
    monkeypatch.setattr(module.typer, "prompt", abort)
    assert heli3dof("profile", "new", "-o", tmp_path / "rig.toml").code == 130
    assert not (tmp_path / "rig.toml").exists()


def test_a_key_with_a_typing_error_is_named_before_missing_ones(tmp_path: Path) -> None:
    result = heli3dof("profile", "new", "--set", "geometry.La=0.66", "-o", tmp_path / "a.toml")
    assert result.code == 2
    assert "no key 'geometry.La'" in result.err
    assert "did you mean 'geometry.L_a'?" in result.err


def test_a_missing_profile_names_the_nearest_file(tmp_path: Path) -> None:
    write(tmp_path / "rig.toml")
    result = heli3dof("profile", "check", tmp_path / "rgi.toml")
    assert result.code == 2
    assert f"did you mean {tmp_path / 'rig.toml'}?" in result.err


def test_no_controller_writes_a_profile_that_says_the_loop_is_unknown(tmp_path: Path) -> None:
    path, other = tmp_path / "rig.toml", tmp_path / "other.toml"
    result = heli3dof("profile", "new", *sets(), "--no-controller", "-o", path)
    assert result.code == 0, result.err
    assert load_profile(path).controller is None
    assert "the controller of imported logs is unknown" in result.err
    assert "Loop: " not in result.out
    start = write(tmp_path / "start.toml", controller={})
    assert load_profile(start).controller is not None
    assert heli3dof("profile", "new", "--from", start, "--no-controller", "-o", other).code == 0
    assert load_profile(other).controller is None
    both = ("--no-controller", "--set", "controller.omega_rad_per_s=100")
    assert heli3dof("profile", "new", *sets(), *both, "-o", tmp_path / "x.toml").code == 2


def test_a_rig_that_the_default_gain_does_not_hold_can_still_have_a_profile(
    tmp_path: Path,
) -> None:
    """Its logs were made with another controller."""
    path = tmp_path / "small.toml"
    small = sets(geometry__L_a=0.2, geometry__L_w=0.1, mass__m_w=0.1, mass__m_f=0.05,
                 mass__m_b=0.05, motor__K_f=0.5, motor__V_o=1)  # fmt: skip
    result = heli3dof("profile", "new", *small, "--no-controller", "-o", path)
    assert result.code == 0, result.err
    assert "Error: " not in result.err
    check = heli3dof("profile", "check", path)
    assert "Loop: UNSTABLE" in check.out
    assert "Error: " not in check.err


def test_a_gain_that_does_not_stabilise_is_not_written(tmp_path: Path) -> None:
    row = "-37.6, 13.2, -11.5, 20.9, 4.7, -16.1, 10.0, -1.0"
    words = [*sets(), "--set", f"controller.K=[[{row}],[{row}]]"]
    result = heli3dof("profile", "new", *words, "-o", tmp_path / "rig.toml")
    assert result.code == 6
    assert not (tmp_path / "rig.toml").exists()


def test_the_command_that_check_prints_corrects_an_unstable_profile(tmp_path: Path) -> None:
    row = [-37.6, 13.2, -11.5, 20.9, 4.7, -16.1, 10.0, -1.0]
    path = write(tmp_path / "rig.toml", controller={"K": [row, row]})
    result = heli3dof("profile", "check", path)
    assert result.code == 6
    assert "heli3dof profile new --from" in result.err
    better = tmp_path / "better.toml"
    assert heli3dof("profile", "new", "--from", path, "-o", better).code == 0
    assert heli3dof("profile", "check", better).code == 0


def test_check_prints_every_error_at_once(tmp_path: Path) -> None:
    text = new_text(TABLE_I)
    for old, new in (
        ("L_a = 0.6604", "L_a = 66.0"),
        ("m_f = 0.575\n", ""),
        ("rate_hz = 500.0\n", ""),
        ("\nyaw = 8192", "\nyaww = 8192"),
        ("V_o = 7.456", "V_o = 30.0"),
    ):
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "bad.toml"
    path.write_text(text)
    result = heli3dof("profile", "check", path)
    assert result.code == 2
    for part in (
        "geometry.L_a = 66.0 is not plausible", "66 centimetres are 0.66 m",
        "'mass.m_f', 'loop.rate_hz' are missing", "unknown key 'encoder.yaww'",
        "did you mean 'yaw'?", "motor.V_o = 30 V is not below motor.v_max = 24 V",
    ):  # fmt: skip
        assert part in result.err, part
    assert "encoder.yaw'" not in result.err, "a misspelt key is not reported as missing too"


def test_show_prints_keys_and_derived_quantities() -> None:
    result = heli3dof("profile", "show", "--json")
    assert result.code == 0
    derived = result.document["derived"]
    assert derived["T_g"] == {"value": pytest.approx(1.170, abs=1e-3), "unit": "N·m"}
    assert derived["J_pitch"]["value"] == pytest.approx(0.03635, abs=1e-5)
    assert derived["V_o of the masses"]["value"] == pytest.approx(-7.456, abs=1e-3)
    assert result.document["profile"] == default_profile().to_dict()


def test_plans_are_listed_with_their_purpose() -> None:
    result = heli3dof("plans", "--json")
    listed = {p["name"]: p for p in result.document["plans"]}
    assert set(listed) == set(named_plans())
    assert listed["ramp"]["duration_s"] == 75.0
    assert "dead zone" in listed["ramp"]["purpose"]
    assert "purpose" in heli3dof("plans").out


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result, Result, Result]:
    """A rig with 20 % less thrust and 0.15 N·m more weight than in its profile, diagnosed before
    and after an update of the profile."""
    folder = tmp_path_factory.mktemp("update")
    slow = {"rate_hz": 250.0}
    believed = write(folder / "rig.toml", limits={"landing_s": 0.5}, loop=slow)
    T_g = default_profile().trim_torque
    K_f = 0.8 * default_profile().motor.K_f
    V_o = T_g / (2 * default_profile().geometry.L_a * K_f)
    write(folder / "truth.toml", motor={"K_f": K_f, "V_o": V_o}, loop=slow)
    device = f"mock:?speed=max&profile={folder / 'truth.toml'}&hide=mass.imbalance:0.15"

    def diagnosed(profile: Path, name: str, seed: int) -> Result:
        flight = folder / f"{name}.mcap"
        words = ("rich", "--device", device, "--profile", profile, "--seed", seed, "-o", flight)
        assert heli3dof("run", *words).code == 0
        model = folder / f"{name}.json"
        return heli3dof("diagnose", flight, "--quick", "-o", model, "--json", "--seed", 1)

    with pytest.MonkeyPatch.context() as few:
        few.setattr(diagnose, "QUICK", diagnose.QUICK._replace(nulls=8, correction=4))
        few.setattr("heli3dof.experiment.plan.load_plan", lambda name: first_part(name, 32.0))
        before = diagnosed(believed, "before", 1250)
        (folder / "diagnosis.json").write_text(before.out)
        updated = heli3dof(
            "profile", "update", "--from", folder / "diagnosis.json", "--profile", believed,
            "-o", folder / "rig2.toml", "--json",
        )  # fmt: skip
        after = diagnosed(folder / "rig2.toml", "after", 1251)
    return folder, before, updated, after


def test_an_updated_profile_reduces_the_simulation_error_to_noise(
    flown: tuple[Path, Result, Result, Result],
) -> None:
    _, before, updated, after = flown
    assert updated.code == 0, updated.err
    wrong, right = (s.document["simulation_error"] for s in (before, after))
    assert wrong["roll"]["rmse_deg"] > 20 * wrong["roll"]["noise_floor_deg"]
    assert wrong["pitch"]["rmse_deg"] > 4 * wrong["pitch"]["noise_floor_deg"]
    for axis, error in right.items():
        assert error["rmse_deg"] < 3 * error["noise_floor_deg"], axis
        assert error["rmse_deg"] < 0.8, axis


def test_the_updated_numbers_are_true(
    flown: tuple[Path, Result, Result, Result],
) -> None:
    folder = flown[0]
    profile = load_profile(folder / "rig2.toml")
    assert profile.motor.K_f == pytest.approx(0.8 * 0.1188, rel=0.06)
    true_V_o = (1.1699 + 0.15) / (2 * 0.6604 * 0.8 * 0.1188)
    assert profile.motor.V_o == pytest.approx(true_V_o, rel=0.005)
    # Torques and inertias are identifiable in units of K_f only.
    masses = default_profile().inertias
    for J, mass in zip(profile.inertias, masses, strict=True):
        assert J / profile.motor.K_f == pytest.approx(mass / (0.8 * 0.1188), rel=0.02)


def test_an_update_keeps_comments_and_names_the_source_of_each_number(
    flown: tuple[Path, Result, Result, Result],
) -> None:
    folder = flown[0]
    old, new = ((folder / n).read_text().splitlines() for n in ("rig.toml", "rig2.toml"))
    kept = [line for line in old if line in new]
    assert len(kept) == len(old) - 2, "K_f and V_o change, nothing else"
    assert any(line.startswith("K_f") and "from diagnosis.json; was 0.1188" in line for line in new)


def test_a_model_file_updates_the_profile_as_the_diagnosis_does(
    flown: tuple[Path, Result, Result, Result],
) -> None:
    folder = flown[0]
    other = folder / "of-model.toml"
    result = heli3dof(
        "profile", "update", "--from", folder / "before.json", "--profile", folder / "rig.toml",
        "-o", other,
    )  # fmt: skip
    assert result.code == 0, result.err
    a, b = load_profile(other), load_profile(folder / "rig2.toml")
    assert a.motor.V_o == pytest.approx(b.motor.V_o, rel=1e-3)
    assert a.motor.K_f == pytest.approx(b.motor.K_f, rel=1e-3)


def test_a_profile_with_a_byte_order_mark_can_be_updated(
    flown: tuple[Path, Result, Result, Result],
) -> None:
    folder = flown[0]
    marked, updated = folder / "marked.toml", folder / "marked-2.toml"
    marked.write_text((folder / "rig.toml").read_text(encoding="utf-8"), encoding="utf-8-sig")
    words = ("--from", folder / "diagnosis.json", "--profile", marked, "-o", updated)
    assert heli3dof("profile", "update", *words).code == 0
    assert updated.read_bytes() == (folder / "rig2.toml").read_bytes()


def test_the_diagnosis_names_the_command(flown: tuple[Path, Result, Result, Result]) -> None:
    folder, before, *_ = flown
    assert f"heli3dof profile update --from {folder / 'before.json'}" in before.err


def test_a_calibration_against_another_profile_is_refused(
    flown: tuple[Path, Result, Result, Result], tmp_path: Path
) -> None:
    source = flown[0] / "diagnosis.json"
    other = write(tmp_path / "other.toml", motor={"K_f": 0.2})
    result = heli3dof("profile", "update", "--from", source, "--profile", other)
    assert result.code == 2
    assert "measured against another profile" in result.err


@pytest.mark.parametrize(
    ("content", "code"),
    [("{}", 5), ("not json", 5), ('{"schema": "heli3dof.diagnosis/1", "calibration": []}', 5)],
)
def test_a_file_without_a_calibration_is_refused(tmp_path: Path, content: str, code: int) -> None:
    source = tmp_path / "x.json"
    source.write_text(content)
    result = heli3dof("profile", "update", "--from", source, "-o", tmp_path / "new.toml")
    assert result.code == code
    assert "heli3dof diagnose" in result.err
    assert not (tmp_path / "new.toml").exists()


def test_encoder_findings_change_the_encoders(tmp_path: Path) -> None:
    source, new = tmp_path / "d.json", tmp_path / "new.toml"
    source.write_text(
        json.dumps(
            {
                "schema": "heli3dof.diagnosis/1",
                "findings": [
                    {"effect": "encoder.offset", "axis": "pitch", "tied_with": [],
                     "parameters": {"angle_deg": {"value": 2.0, "std": 0.1}}},
                    {"effect": "encoder.scale", "axis": "yaw", "tied_with": [],
                     "parameters": {"scale": {"value": 0.5, "std": 0.01}}},
                    {"effect": "friction.coulomb", "axis": "yaw", "tied_with": [],
                     "parameters": {"torque_Nm": {"value": 0.02, "std": 0.001}}},
                ],
                "integrity": [{"check": "encoder.sign", "axis": "roll", "confidence": 0.99}],
            }
        )
    )  # fmt: skip
    result = heli3dof("profile", "update", "--from", source, "-o", new)
    assert result.code == 0, result.err
    encoder = load_profile(new).encoder
    assert (encoder.roll, encoder.yaw, encoder.pitch_rest_deg) == (-4096, 4096, -2.0)
    assert "No key of a profile holds: friction.coulomb.yaw" in result.err
