"""``heli3dof import``: preview, mapping, several files, errors with their correction."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from heli3dof.recording.load import load
from tests.cli.running import heli3dof
from tests.cli.test_bad_input import RIG
from tests.recording.make import csv_text, flight, log_columns

MAP = (
    "--map", "v_front_V=(input[1]-input[2])/2", "--map", "v_back_V=(input[1]+input[2])/2",
    "--map", "roll_deg=degrees(x_enc[1])", "--map", "pitch_rad=-x_enc[2]",
)  # fmt: skip


@pytest.fixture
def raw(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[str, str]:
    """A flight as two "To File" matrices: sum and back − front of the voltages; two angles."""
    monkeypatch.chdir(tmp_path)
    r = flight(1500)
    V = r.voltage
    savemat("input.mat", {"ans": np.vstack([r.t, V.sum(1), V[:, 1] - V[:, 0]])})
    savemat("x_enc.mat", {"ans": np.vstack([r.t, r.angle[:, 0], -r.angle[:, 1]])})
    return "input.mat", "x_enc.mat"


def test_two_raw_files_become_one_recording(raw: tuple[str, str]) -> None:
    done = heli3dof("import", *raw, "--profile", RIG, *MAP, "-o", "rec.mcap")
    assert done.code == 0, done.err
    made, r = flight(1500), load("rec.mcap")
    np.testing.assert_allclose(r.voltage, made.voltage, atol=1e-12)
    np.testing.assert_allclose(r.angle[:, :2], made.angle[:, :2], atol=1e-12)
    assert heli3dof("info", "rec.mcap").code == 0


def test_without_an_output_only_the_preview_is_printed(raw: tuple[str, str]) -> None:
    done = heli3dof("import", *raw, "--profile", RIG, *MAP, "--json")
    assert done.code == 0
    found = {column["name"]: column for column in done.document["import"]["columns"]}
    assert done.document["file"] is None
    assert found["pitch_rad"]["source"] == "-x_enc[2]"
    assert found["roll_deg"]["max"] == pytest.approx(np.degrees(flight(1500).angle[:, 0].max()))
    assert done.document["import"]["period_s"] == pytest.approx(0.002)
    assert "Nothing was written" in done.err
    assert sorted(p.name for p in Path().iterdir()) == sorted(raw)


def test_the_printed_table_keeps_the_mapping_in_a_profile(raw: tuple[str, str]) -> None:
    shown = heli3dof("import", *raw, "--profile", RIG, *MAP, "-o", "rec.mcap").out
    table = shown[shown.index("[log]") :]
    assert heli3dof("import", *raw, "--profile", RIG, *MAP).out.endswith(table)
    assert tomllib.loads(table)["log"]["roll_deg"] == "degrees(x_enc[1])"
    Path("rig.toml").write_text(f"{RIG.read_text()}\n{table}")
    by_profile = heli3dof("import", *raw, "--profile", "rig.toml", "--json").document
    by_options = heli3dof("import", *raw, "--profile", RIG, *MAP, "--json").document
    assert by_profile["digest"] == by_options["digest"]
    again = heli3dof("import", *raw, "--profile", "rig.toml", *MAP, "--map", "yaw_rad=x_enc[2]").out
    assert again.endswith('add to [log] of rig.toml:\nyaw_rad = "x_enc[2]"\n')


def test_a_log_without_our_names_shows_its_own_before_the_error(raw: tuple[str, str]) -> None:
    done = heli3dof("import", *raw, "--profile", RIG)
    assert done.code == 5
    assert "x_enc[2]" in done.out
    assert "no column v_front_V, v_back_V" in done.err


def test_common_names_of_a_csv_are_suggested_as_options(tmp_path: Path) -> None:
    names = {"t_s": "time", "v_front_V": "Vf", "v_back_V": "Vb", "roll_deg": "elevation_deg"}
    data = {names[n]: v for n, v in log_columns(flight(1500)).items() if n in names}
    (tmp_path / "log.csv").write_text(csv_text(data))
    done = heli3dof("import", tmp_path / "log.csv", "--profile", RIG)
    options = ("--map v_front_V=Vf", "--map v_back_V=Vb", "--map roll_deg=elevation_deg")
    assert done.code == 5
    assert all(option in done.err for option in options)
    named = f"import {tmp_path / 'log.csv'} --profile {RIG} -o log.mcap --map"
    assert named in done.err
    assert named in heli3dof("identify", tmp_path / "log.csv", "--profile", RIG).err
    refused = heli3dof("diagnose", tmp_path / "log.csv", "--profile", RIG)
    assert "Verdict: bad data. The log cannot be imported as it is." in refused.out + refused.err
    words = " ".join(options).split()
    assert heli3dof("import", tmp_path / "log.csv", "--profile", RIG, *words).code == 0


@pytest.mark.parametrize(
    ("mapping", "code", "what", "fix"),
    [
        ("v_front_V=input[3]", 2, "names 'input[3]'", "input[1], input[2]"),
        ("v_frnt_V=input[1]", 2, "no column v_frnt_V", "--map OUR_COLUMN"),
        ("v_front_V=(input[1]", 2, "is not an expression", "parentheses"),
        (
            "v_front_V=1000*input[1]",
            5,
            "v_front_V reaches",
            "--map 'v_front_V=(1000*input[1])/1000'",
        ),
        ("roll_rad=degrees(x_enc[1])", 5, "roll_rad does not look like radians", "--map roll_deg="),
        ("yaw_rad=777.7*x_enc[1]", 5, "yaw_rad does not look like radians", "--map yaw_deg="),
        ("t_s=1000*t_s", 5, "t_s is in milliseconds", "--map 't_s=(1000*t_s)/1000'"),
    ],
)
def test_a_wrong_mapping_is_refused_with_its_correction(
    raw: tuple[str, str], mapping: str, code: int, what: str, fix: str
) -> None:
    target = mapping.partition("=")[0]
    kept = [w for o in range(0, len(MAP), 2) if not MAP[o + 1].startswith(f"{target[:5]}")
            for w in MAP[o : o + 2]]  # fmt: skip
    done = heli3dof("import", *raw, "--profile", RIG, *kept, "--map", mapping, "-o", "rec.mcap")
    assert done.code == code
    assert what in done.err
    assert fix in done.err
    assert not Path("rec.mcap").exists()


def test_names_of_columns_are_for_one_file_only(raw: tuple[str, str]) -> None:
    done = heli3dof("import", *raw, "--profile", RIG, "--columns", "t_s,v_front_V,v_back_V")
    assert done.code == 2
    assert "columns names the columns of one file" in done.err


def test_a_profile_with_an_unknown_column_is_refused(raw: tuple[str, str]) -> None:
    Path("rig.toml").write_text(f'{RIG.read_text()}\n[log]\nrol_deg = "x_enc[1]"\n')
    done = heli3dof("import", *raw, "--profile", "rig.toml")
    assert done.code == 2
    assert "unknown key log.rol_deg" in done.err
    assert "did you mean 'roll_deg'?" in done.err


def test_held_angles_are_imported_at_their_rate(tmp_path: Path) -> None:
    r = flight(3000)
    row = np.arange(3000) // 10 * 10
    yaw = np.round(200 * np.sin(row / 150)) * float(np.degrees(r.profile.encoder.rad_per_count[2]))
    log, rec = tmp_path / "log.csv", tmp_path / "rec.mcap"
    log.write_text(csv_text(log_columns(r) | {"yaw_deg": yaw}))
    done = heli3dof("import", log, "--profile", RIG)
    assert "Held angles: the angles change in some rows only: yaw every 10 rows (50 Hz)" in done.err
    assert "import the log with --rate 50" in done.err
    done = heli3dof("import", log, "--profile", RIG, "--rate", "50", "-o", rec)
    assert "300 of 3000 rows are kept" in done.out
    read = load(rec)
    assert read.profile.loop.rate_hz == 50
    np.testing.assert_allclose(read.voltage[3], r.voltage[30:40].mean(axis=0))


def test_labview_s_time_is_suggested(tmp_path: Path) -> None:
    data = {"X_Value" if n == "t_s" else n: v for n, v in log_columns(flight(1500)).items()}
    (tmp_path / "log.csv").write_text(csv_text(data))
    done = heli3dof("import", tmp_path / "log.csv", "--profile", RIG)
    assert done.err.rstrip().endswith("--map t_s=X_Value")


def test_the_period_is_rounded_and_the_first_time_shown(tmp_path: Path) -> None:
    data = log_columns(flight(1500))
    data["t_s"] = np.float32(37 + np.array(data["t_s"])).astype(float)
    (tmp_path / "log.csv").write_text(csv_text(data))
    rec = tmp_path / "rec.mcap"
    done = heli3dof("import", tmp_path / "log.csv", "--profile", RIG, "-o", rec)
    assert "from 37 s, every 0.002 s (median)" in done.out
    assert "from 37 s" in heli3dof("info", rec).out
