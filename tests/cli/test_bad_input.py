"""Bad input gives a clear error and the right exit code, and no file is lost."""

from __future__ import annotations

import io
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from heli3dof.experiment.plan import step_plan
from heli3dof.recording.recording import Recording
from heli3dof.recording.write import write_recording
from tests.cli.running import heli3dof
from tests.flown import flown

RIG = Path(__file__).parents[2] / "recordings" / "rig.toml"
GRID = 360 / 4096


def log(n: int = 4000, dt: float = 0.002, **columns: np.ndarray | None) -> str:
    """A CSV log of a small wandering flight, with columns replaced or (None) omitted."""
    rng = np.random.default_rng(1)
    t = np.arange(n) * dt
    data: dict[str, np.ndarray | None] = {
        "t_s": t,
        "v_front_V": 7 + np.sin(t) + 0.1 * rng.standard_normal(n),
        "v_back_V": 7 + np.cos(t) + 0.1 * rng.standard_normal(n),
        "roll_deg": np.round(10 * np.sin(0.5 * t) / GRID) * GRID,
        "pitch_deg": np.round(8 * np.sin(1.5 * t) / GRID) * GRID,
        "yaw_deg": np.round(20 * np.sin(0.3 * t) / GRID) * GRID,
    }
    data.update(columns)
    kept = {k: v for k, v in data.items() if v is not None}
    out = io.StringIO()
    out.write(",".join(kept) + "\n")
    np.savetxt(out, np.column_stack(list(kept.values())), delimiter=",", fmt="%.8g")
    return out.getvalue()


def changed(column: str, row: int, value: float) -> str:
    lines = log().splitlines()
    names = lines[0].split(",")
    cells = lines[row + 1].split(",")
    cells[names.index(column)] = str(value)
    lines[row + 1] = ",".join(cells)
    return "\n".join(lines) + "\n"


def radians_as_degrees() -> str:
    n = 4000
    t = np.arange(n) * 0.002
    grid = np.radians(GRID)
    return log(
        roll_deg=np.round(np.radians(10) * np.sin(0.5 * t) / grid) * grid,
        pitch_deg=np.round(np.radians(8) * np.sin(1.5 * t) / grid) * grid,
        yaw_deg=np.round(np.radians(20) * np.sin(0.3 * t) / grid) * grid,
    )


@pytest.mark.parametrize(
    ("text", "hints"),
    [
        (log(v_back_V=None), ["v_back_V"]),
        (log().replace("v_back_V", "v_bak_V"), ["v_back_V", "v_bak_V"]),
        (log(t_s=None), ["t_s"]),
        (radians_as_degrees(), ["radian"]),
        (changed("t_s", 100, 0.0), ["102"]),  # the file's line, the header being line 1
        (log(roll_deg=np.full(4000, np.inf)), ["roll_deg", "infinity"]),
        (log(n=2), ["2"]),
        ("", ["is empty"]),
    ],
    ids=[
        "missing",
        "misspelt",
        "no time",
        "radians",
        "time",
        "nan",
        "two samples",
        "empty",
    ],
)
def test_a_bad_log_is_refused_with_the_reason(text: str, hints: list, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text)
    result = heli3dof("import", path, "--profile", RIG, "-o", tmp_path / "rec.mcap")
    assert result.code == 5, result.err
    for hint in hints:
        assert hint in result.err
    assert "Try:" in result.err
    assert not (tmp_path / "rec.mcap").exists()


def test_a_log_without_a_profile_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(log())
    for verb in ("import", "identify", "info", "compare", "report"):
        result = heli3dof(verb, path)
        assert result.code == 2
        assert "--profile" in result.err


@pytest.mark.parametrize(
    ("columns", "hints"),
    [
        ({"pitch_deg": None, "yaw_deg": None}, ["pitch"]),
        ({"v_front_V": np.full(4000, 7.0), "v_back_V": np.full(4000, 7.0)}, ["constant"]),
    ],
    ids=["one angle only", "a constant input"],
)
def test_identify_refuses_a_log_with_too_little_information(
    columns: dict, hints: list, tmp_path: Path
) -> None:
    path = tmp_path / "log.csv"
    path.write_text(log(**columns))
    assert heli3dof("import", path, "--profile", RIG, "-o", tmp_path / "rec.mcap").code == 0
    result = heli3dof("identify", tmp_path / "rec.mcap", "-o", tmp_path / "m.json")
    assert result.code == 5, result.err
    for hint in hints:
        assert hint in result.err
    assert not (tmp_path / "m.json").exists()


def test_jitter_and_gaps_are_warnings(tmp_path: Path) -> None:
    t = np.arange(4000) * 0.002
    t[2000:] += 0.5
    t += 0.0004 * np.random.default_rng(0).random(4000)
    path = tmp_path / "log.csv"
    path.write_text(log(t_s=t))
    result = heli3dof("import", path, "--profile", RIG, "-o", tmp_path / "rec.mcap")
    assert result.code == 0
    assert "gap" in result.err
    assert "Warning" in result.err


def foreign_mcap(path: Path) -> None:
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("pose", "jsonschema", b"{}")
        channel = writer.register_channel("/camera/pose", "json", schema)
        writer.add_message(channel, 0, b'{"x": 1}', 0)
        writer.finish()


@pytest.mark.parametrize("verb", ["info", "identify", "compare", "report", "export"])
def test_a_file_that_is_not_a_recording_exits_with_5(verb: str, tmp_path: Path) -> None:
    text = tmp_path / "notes.mcap"
    text.write_text("just some notes\n")
    foreign_mcap(tmp_path / "foreign.mcap")
    for path, hint in (
        (tmp_path / "missing.mcap", "no recording"),
        (text, "text"),
        (tmp_path / "foreign.mcap", "/camera/pose"),
    ):
        result = heli3dof(verb, path)
        assert result.code == 5, result.err
        assert hint in result.err


def test_a_file_that_is_not_a_model_exits_with_5(tmp_path: Path) -> None:
    rec = tmp_path / "r.mcap"
    heli3dof("simulate", "steps", "--model", "hover", "-o", rec)
    for text, hint in (("{", "JSON"), ('{"schema": "heli3dof.model/99"}', "99"), ("[]", "model")):
        model = tmp_path / "model.json"
        model.write_text(text)
        result = heli3dof("compare", rec, model, "-o", tmp_path / "out")
        assert result.code == 5, result.err
        assert hint in result.err


@cache
def flown_step() -> Recording:
    return flown(step_plan((5.0, None, None)), device="mock:?speed=max", seed=1300)


def recording(path: Path, **geometry: float) -> Path:
    """Write a short flight of the mock rig, with a changed geometry in its profile."""
    flown = flown_step()
    body = flown.profile.geometry.model_copy(update=geometry)
    other = flown.profile.model_copy(update={"geometry": body})
    part = flown.between(0.0, 12.0 + len(geometry))
    write_recording(replace(part, profile=other, meta={"name": path.stem}), path)
    return path


def test_flights_of_two_rigs_are_refused(tmp_path: Path) -> None:
    one = recording(tmp_path / "one.mcap")
    two = recording(tmp_path / "two.mcap", L_a=0.5)
    for verb in ("diagnose", "identify"):
        for words in ((one, two), (one, "--holdout", two)):
            result = heli3dof(verb, *words, "-o", tmp_path / "m.json")
            assert result.code == 2, result.err
            assert "two is of another rig than one: geometry.L_a = 0.5 and 0.66" in result.err
            assert "--profile FILE.toml" in result.err
    same = heli3dof("identify", one, "--holdout", one, "-o", tmp_path / "m.json")
    assert same.code == 2
    assert "cannot be used as hold-out data" in same.err


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("cut", [0, 1])
def test_a_log_in_utf_16_is_read(encoding: str, cut: int, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    data = log(n=200).encode(encoding)
    path.write_bytes(data[: len(data) - cut])
    result = heli3dof("info", path, "--profile", RIG, "--json")
    assert result.code == 0, result.err
    assert result.document["samples"] >= 199


def test_decimal_commas_in_a_comma_separated_log_are_named(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    header, *rows = log(n=200).splitlines()
    path.write_text("\n".join([header, *(r.replace(".", ",") for r in rows)]))
    result = heli3dof("info", path, "--profile", RIG)
    assert result.code == 5
    assert "decimal commas" in result.err


def test_a_recording_cannot_be_imported(tmp_path: Path) -> None:
    one = recording(tmp_path / "one.mcap")
    for profile in ((), ("--profile", RIG)):
        result = heli3dof("import", one, *profile, "-o", tmp_path / "two.mcap")
        assert result.code == 5
        assert "is a recording already" in result.err


@pytest.mark.parametrize(
    "words",
    [
        ("export", "REC", "-o", "/proc/x.csv"),
        ("report", "REC", "-o", "/proc/x.html"),
        ("compare", "REC", "-o", "/dev/full"),
        ("compare", "REC", "-o", "/proc/figures"),
        ("simulate", "steps", "--model", "hover", "-o", "/proc/x.mcap"),
        ("simulate", "steps", "--model", "hover", "-o", f"{'x' * 300}.mcap"),
    ],
)
def test_an_output_that_cannot_be_created_exits_with_2(
    words: tuple[str, ...], tmp_path: Path
) -> None:
    rec = recording(tmp_path / "one.mcap") if "REC" in words else ""
    result = heli3dof(*(rec if w == "REC" else w for w in words))
    assert result.code == 2, result.err
    assert "cannot be written" in result.err
    assert "another place with -o" in result.err


@pytest.mark.parametrize("verb", ["export", "report", "simulate"])
def test_a_full_disk_is_reported(verb: str, tmp_path: Path) -> None:
    what = (
        ("steps", "--model", "hover") if verb == "simulate" else (recording(tmp_path / "r.mcap"),)
    )
    link = tmp_path / {"export": "x.csv", "report": "x.html", "simulate": "x.mcap"}[verb]
    link.symlink_to("/dev/full")
    result = heli3dof(verb, *what, "-o", link, "--force")
    assert result.code == 5, result.err
    assert "no space left" in result.err
    assert "df -h" in result.err


def test_a_negative_seed_is_a_usage_error(tmp_path: Path) -> None:
    result = heli3dof("simulate", "steps", "--model", "hover", "--seed", "-1")
    assert result.code == 2
    assert "--seed" in result.err


@pytest.mark.parametrize(
    ("words", "fix"),
    [
        (("recover", "rig 1/whole.mcap"), "heli3dof info 'rig 1/whole.mcap'"),
        (("identify", "rig 1/torn.mcap"), "heli3dof recover 'rig 1/torn.mcap'"),
        (("info", "rig 1/torn.mcap"), "heli3dof recover 'rig 1/torn.mcap'"),
        (("info", "rig 1/0815.mcap"), "ls 'rig 1'"),
        (("info", "rig 1"), "ls 'rig 1'"),
        (("info", "rig 1/m.json"), "heli3dof compare REC... 'rig 1/m.json'"),
        (("import", "rig 1/log.csv"), "heli3dof import 'rig 1/log.csv' --profile PROFILE.toml"),
        (("run", "rig 1/0815.toml"), "ls 'rig 1'"),
        (("simulate", "rich", "--model", "rig 1/0815-4711.json"), "ls 'rig 1'"),
        (("export", "rig 1/whole.mcap", "-o", "no dir/x.csv"), "mkdir -p 'no dir'"),
        (("recover", "rig 1/torn.mcap", "-o", "rig 1"), "-o 'rig 1/recording.mcap'"),
        (("export", "rig 1/whole.mcap", "-o", "rig 1"), "-o 'rig 1/recording.mcap'"),
        (("batch", "identify", "rig 1/*.xyz", "-o", "out"), "ls 'rig 1/'*.xyz"),
    ],
)  # fmt: skip
def test_names_with_spaces_are_quoted_in_commands(
    words: tuple[str, ...], fix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("rig 1").mkdir()
    whole = recording(Path("rig 1/whole.mcap"))
    Path("rig 1/torn.mcap").write_bytes(whole.read_bytes()[:-100])
    Path("rig 1/log.csv").write_text(log(n=10), encoding="utf-8")
    Path("rig 1/m.json").write_text('{"schema": "heli3dof.model/1"}', encoding="utf-8")
    assert fix in heli3dof(*words, "--json").document["fix"]


def test_a_similar_name_replaces_the_command_that_lists_the_folder(tmp_path: Path) -> None:
    recording(tmp_path / "cable.mcap")
    error = heli3dof("info", tmp_path / "cabel.mcap", "--json").document
    assert f"did you mean {tmp_path / 'cable.mcap'}?" in error["cause"]
    assert error["fix"] == f"again with {tmp_path / 'cable.mcap'}"


def test_a_recording_given_as_model_is_named(tmp_path: Path) -> None:
    given = tmp_path / "rec.mcap"
    given.write_bytes(b"\x89MCAP0\r\n\xff")
    error = heli3dof("simulate", "steps", "--model", given, "--json").document
    assert "codec" not in error["error"]
    assert "another kind of file (a recording?)" in error["cause"]


def test_a_damaged_recording_given_as_profile_is_named(tmp_path: Path) -> None:
    given = tmp_path / "rec.mcap"
    given.write_bytes(b"\x89MCAP0\r\n\xff")
    error = heli3dof("simulate", "steps", "--profile", given, "--json").document
    assert str(given) in error["error"]
    assert "recover" in error["fix"]


def test_a_profile_and_a_plan_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    profile, plan = tmp_path / "rig.toml", tmp_path / "plan.toml"
    profile.write_text(RIG.read_text(encoding="utf-8"), encoding="utf-8-sig")
    text = 'name = "hold"\n[[segment]]\nkind = "hold"\nduration_s = 1\n'
    plan.write_text(text, encoding="utf-8-sig")
    result = heli3dof("run", plan, "--profile", profile, "--dry-run")
    assert result.code == 0, result.err
