"""Any input ends with an error message and the contract's exit code, never an internal error."""

from __future__ import annotations

import itertools
import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest

from heli3dof.cli.compare import _figure_path
from heli3dof.model.linear.hover import hover_model
from heli3dof.model.model_file import save_model
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.rig.profile import default_profile
from tests.cli.running import Result, heli3dof
from tests.cli.test_bad_input import RIG, log, recording

STEP = (
    "run-step", "--roll", "10", "--settle", "0.5", "--duration", "3",
    "--device", "mock:?speed=max&seed=1&start=level",
)  # fmt: skip
SENSELESS = ("nan", "inf", "1e308", "-1", "0", "1e-308", '"text"', "[]", "true", "9" * 30)


@pytest.fixture(scope="module")
def bad(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of invalid files, and of a valid ``rec.mcap`` and ``m.json``."""
    folder = tmp_path_factory.mktemp("größe mit Leer")
    rec = recording(folder / "rec.mcap")
    model = save_model(hover_model(default_profile()), folder / "m.json")
    (folder / "folder.mcap").mkdir()
    (folder / "torn.mcap").write_bytes(rec.read_bytes()[:60_000])
    (folder / "head.mcap").write_bytes(rec.read_bytes()[:40])
    junk = bytes(range(256)) * 20
    for ending in ("mcap", "csv", "csv.gz", "mat", "json", "toml"):
        (folder / f"empty.{ending}").touch()
        (folder / f"junk.{ending}").write_bytes(junk)
    (folder / "rec.json").write_bytes(rec.read_bytes())
    (folder / "model.mcap").write_bytes(model.read_bytes())
    (folder / "nan.json").write_text('{"schema": "heli3dof.model/1", "form": NaN}')
    (folder / "deep.json").write_text("[" * 9000)
    (folder / "deep.toml").write_text("a = " + "[" * 9000)
    (folder / "two.csv").write_text(log(n=2))
    (folder / "inf.csv").write_text(re.sub(r"^\d[^,]*,", "inf,", log(n=200), flags=re.MULTILINE))
    return folder


def judged(result: Result, *codes: int) -> None:
    assert result.code in (codes or (2, 5)), result.err
    assert "Error: " in result.err
    assert "Try: " in result.err
    assert "internal error" not in result.err
    assert "Traceback" not in result.err


RECORDINGS = (
    "missing.mcap", "folder.mcap", "head.mcap", "empty.mcap", "junk.mcap", "model.mcap",
    "junk.csv", "empty.csv", "junk.csv.gz", "junk.mat", "empty.mat", "two.csv", "inf.csv",
    "junk.toml", "nan.json",
)  # fmt: skip


@pytest.mark.parametrize("words", ["info", "export -o log.csv", "identify"])
def test_a_recording_with_another_ending_is_read(
    words: str, bad: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    verb, *options = words.split()
    assert heli3dof(verb, bad / "rec.json", *options).code == 0


@pytest.mark.parametrize("verb", ["info", "export", "identify", "diagnose", "compare", "report"])
@pytest.mark.parametrize("name", RECORDINGS)
def test_every_verb_refuses_a_file_that_is_not_a_recording(verb: str, name: str, bad: Path) -> None:
    result = heli3dof(verb, bad / name, "--profile", RIG)
    if verb == "diagnose" and result.code == 5 and "Error: " not in result.err:
        # An unusable log gives a verdict, not an error.
        assert "cannot be imported" in result.out
        return
    judged(result)


@pytest.mark.parametrize(
    ("words", "name"),
    [
        *itertools.product([("info",), ("import",), ("recover",)], ["pipe.csv", "/dev/zero"]),
        (("info",), "pipe.mcap"),
        (("batch", "identify"), "pipe.mcap"),
    ],
)
def test_a_pipe_or_a_device_is_refused_without_reading_it(
    words: tuple[str, ...], name: str, tmp_path: Path
) -> None:
    if not name.startswith("/"):
        os.mkfifo(tmp_path / name)
    more = {"import": ("--profile", RIG), "batch": ("-o", tmp_path / "out")}.get(words[0], ())
    done = heli3dof(*words, tmp_path / name, *more)
    assert done.code == 5
    table = tmp_path / "out" / "results.csv"
    text = table.read_text(encoding="utf-8") if words[0] == "batch" else done.err
    assert "is a pipe or a device, not a file" in text


@pytest.mark.parametrize("name", ["missing.mcap", "folder.mcap", "junk.mcap", "rec.mcap"])
def test_recover_refuses_complete_and_foreign_files(name: str, bad: Path, tmp_path: Path) -> None:
    judged(heli3dof("recover", bad / name, "-o", tmp_path / "r.mcap"))


MODELS = (
    "missing.json", "empty.json", "junk.json", "nan.json", "deep.json", "rec.json", "rec.mcap",
    "folder.mcap", "no-such-model",
)  # fmt: skip


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("verb", ["simulate", "report"])
def test_a_file_that_is_no_model_is_refused(
    name: str, verb: str, bad: Path, tmp_path: Path
) -> None:
    model = name if name == "no-such-model" else bad / name
    what = ("simulate", "steps") if verb == "simulate" else ("report", bad / "rec.mcap")
    judged(heli3dof(*what, "--model", model, "-o", tmp_path / "out.html"))


@pytest.mark.parametrize("name", ["missing.toml", "empty.toml", "junk.toml", "deep.toml", "m.json"])
@pytest.mark.parametrize("what", ["plan", "profile"])
def test_a_file_that_is_not_a_plan_or_profile_is_refused(name: str, what: str, bad: Path) -> None:
    words = (bad / name,) if what == "plan" else ("rich", "--profile", bad / name)
    judged(heli3dof("run", *words, "--dry-run"), 2)


@pytest.mark.parametrize("value", SENSELESS)
@pytest.mark.parametrize(
    "key", ["hold.duration_s", "multisine.duration_s", "prbs.bit_s", "step.roll_deg"]
)
def test_impossible_numbers_in_a_plan_are_refused(key: str, value: str, tmp_path: Path) -> None:
    kind, name = key.split(".")
    length = "" if name == "duration_s" else "duration_s = 2\n"
    plan = tmp_path / "p.toml"
    plan.write_text(f'name = "p"\n[[segment]]\nkind = "{kind}"\n{length}{name} = {value}\n')
    result = heli3dof("run", plan, "--dry-run")
    if result.code:
        judged(result, 2)
    else:
        assert value == "1e-308" or (key == "step.roll_deg" and value in ("-1", "0"))


@pytest.mark.parametrize("value", SENSELESS)
@pytest.mark.parametrize("key", ["L_a", "V_o", "roll", "rate_hz", "v_max"])
def test_impossible_numbers_in_a_profile_are_refused(key: str, value: str, tmp_path: Path) -> None:
    lines = RIG.read_text(encoding="utf-8").splitlines()
    results = [i for i, line in enumerate(lines) if line.split("=")[0].strip() == key]
    lines[results[0]] = f"{key} = {value}"
    profile = tmp_path / "rig.toml"
    profile.write_text("\n".join(lines), encoding="utf-8")
    result = heli3dof("run", "rich", "--dry-run", "--profile", profile)
    if (key, value) == ("roll", "-1"):
        assert result.code == 0, "one count a turn: profile check reports it as unusual"
        return
    judged(result, 2, 6)


# Outputs: every verb checks at its start that it can write at its end.

WRITERS = {
    "identify": ("identify", "rec.mcap"),
    "diagnose": ("diagnose", "rec.mcap"),
    "report": ("report", "rec.mcap"),
    "simulate": ("simulate", "steps"),
    "run-step": STEP,
    "run": ("run", "steps", "--device", "mock:?speed=max"),
    "import": ("import", "log.csv", "--profile", RIG),
    "export": ("export", "rec.mcap"),
    "recover": ("recover", "torn.mcap"),
    "identify --report": ("identify", "rec.mcap"),
    "diagnose --report": ("diagnose", "rec.mcap"),
}


@pytest.fixture
def no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail the test if a verb computes or flies before it checks its output."""

    def reached(*_: object, **__: object) -> None:
        raise AssertionError("the work began")

    for module in ("recording.info", "diagnosis.planning.run_auto"):
        import_module(f"heli3dof.{module}")  # else they would keep the replaced functions
    for module, name in (
        ("identification.identify", "identify"), ("diagnosis.diagnose", "diagnose"),
        ("comparison.compare", "compare"), ("experiment.simulate", "simulate"),
        ("experiment.fly", "fly_plan"), ("recording.load", "load"),
        ("recording.logs.import_log", "read_log"),
    ):  # fmt: skip
        monkeypatch.setattr(import_module(f"heli3dof.{module}"), name, reached)


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(
    "place", ["no/such/x.csv", "folder", "there.csv", "/proc/x.csv", "file/x.csv"]
)
@pytest.mark.parametrize("writer", WRITERS)
def test_an_output_that_cannot_be_written_is_refused_before_any_work(
    writer: str, place: str, bad: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("there.csv").write_text("mine")
    Path("file").touch()
    (bad / "log.csv").write_text(log(n=100))
    words = [bad / w if (bad / str(w)).is_file() else w for w in WRITERS[writer]]
    option = "--report" if "--report" in writer else "-o"
    result = heli3dof(*words, option, place)
    judged(result, 2)
    assert Path("there.csv").read_text() == "mine"
    assert sorted(p.name for p in Path().iterdir()) == ["file", "folder", "there.csv"]


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("writer", ["identify", "diagnose", "report", "export", "import"])
def test_no_verb_overwrites_its_input(
    writer: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text(text := log(n=100))
    result = heli3dof(writer, "log.csv", "--profile", RIG, "-o", "log.csv", "--force")
    judged(result, 2)
    assert "is an input and cannot be the output" in result.err
    assert Path("log.csv").read_text() == text


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("place", ["file", "/proc/figures", "/dev/null"])
def test_compare_checks_its_folder_before_any_work(
    place: str, bad: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    judged(heli3dof("compare", bad / "rec.mcap", "-o", place), 2)


def test_compare_keeps_existing_figures(bad: Path, tmp_path: Path) -> None:
    (tmp_path / "rec-yaw.svg").write_text("mine")
    judged(heli3dof("compare", bad / "rec.mcap", "-o", tmp_path), 2)
    assert [p.name for p in tmp_path.iterdir()] == ["rec-yaw.svg"]


def test_a_recordings_name_does_not_lead_to_another_folder(bad: Path, tmp_path: Path) -> None:
    flight = read_recording(bad / "rec.mcap")
    named = replace(flight, meta={**flight.meta, "name": "../evil"})
    assert _figure_path(tmp_path, named, "roll", "svg").parent == tmp_path


@pytest.mark.parametrize("words", [STEP, ("run", "--auto", *STEP[-2:]), ("demo",)])
def test_a_default_folder_that_cannot_be_created_exits_with_2(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("flights").touch()
    if words == ("demo",):
        monkeypatch.chdir("/proc")
    result = heli3dof(*words)
    judged(result, 2)
    assert "cannot be written" in result.err
    monkeypatch.chdir(tmp_path)
    (gone := tmp_path / "gone").mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    judged(heli3dof(*words), 2)


# The process: its streams and its environment.


def shell(line: str, **more: str) -> subprocess.CompletedProcess[bytes]:
    command = line.replace("heli3dof", f"'{sys.executable}' -m heli3dof", 1)
    return subprocess.run(
        ["bash", "-o", "pipefail", "-c", command], capture_output=True, check=False,
        env={**os.environ, **more},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("words", "redirected", "code"),
    [
        ("info REC", "2>&-", 0),
        ("info REC --json", ">&- 2>&- <&-", 0),
        *(
            (words, *case)
            for words in ("--help", "info REC", "info REC --json")
            for case in (("| head -c 5 >/dev/null", 0), (">&-", 0), ("> /dev/full", 5))
        ),
    ],
)
def test_closed_and_full_streams_are_no_internal_error(
    words: str, redirected: str, code: int, bad: Path
) -> None:
    done = shell(f"heli3dof {words} {redirected}".replace("REC", f"'{bad / 'rec.mcap'}'"))
    assert done.returncode == code, done.stderr
    for word in (b"Traceback", b"internal error", b"ignored"):
        assert word not in done.stderr
    assert code != 5 or b"cannot be written: No space left" in done.stderr


def test_a_recording_never_gets_the_descriptor_of_a_closed_stream(tmp_path: Path) -> None:
    path = tmp_path / "s.mcap"
    line = " ".join(f"'{w}'" for w in (*STEP, "-o", path))
    assert shell(f"heli3dof {line} >&- 2>&- <&-").returncode == 0
    assert heli3dof("info", path, "--json").document["outcome"] == "completed"


def test_the_environment_changes_no_exit_code(bad: Path) -> None:
    surroundings = {
        "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0",
        "COLUMNS": "20", "TERM": "dumb",
        "HOME": "/nonexistent", "TMPDIR": "/nonexistent", "MPLCONFIGDIR": "/proc/x",
    }  # fmt: skip
    done = shell(f"heli3dof info '{bad / 'rec.mcap'}' --json", **surroundings)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["name"] == "rec"
    assert shell("heli3dof run rich --dry-run", **surroundings).returncode == 0
