"""The command line as a whole: verbs from files and plug-ins, quick start, renamed options."""

from __future__ import annotations

import inspect
import json
import re
import subprocess
import sys
from importlib.metadata import EntryPoint, version
from pathlib import Path

import pytest
import typer
from typer.main import get_command
from typer.testing import CliRunner

from heli3dof import cli, plugins
from heli3dof.cli import app as command_line
from heli3dof.cli.estop import estop, estop_without_typer
from tests.cli.running import heli3dof
from tests.rig.fakes import FakeDriver, only_drivers

HEAVY = ("numpy", "scipy", "numba", "mcap", "matplotlib", "pydantic")
RUN = "import sys; from heli3dof.cli.app import main; sys.argv = ['heli3dof', *{words}]\n"
PRINT = "try: main()\nexcept SystemExit: pass\nprint([m for m in {heavy} if m in sys.modules])"


def headings(text: str) -> dict[str, list[str]]:
    """Heading → verbs, in the order of the help's text."""
    found: dict[str, list[str]] = {}
    for line in text[text.index("Options:") :].splitlines():
        if heading := re.match(r"(\w[\w ]*):$", line):
            listed = found.setdefault(heading[1], [])
        elif verb := re.match(r"  ([a-z][\w-]*)(?: |$)", line):
            listed.append(verb[1])
    del found["Options"]
    return found


def test_help_lists_every_verb_under_its_heading_in_the_order_of_the_families() -> None:
    found = headings(heli3dof("--help").out)
    assert tuple(found)[: len(command_line.FAMILIES)] == command_line.FAMILIES
    listed = [verb for verbs in found.values() for verb in verbs]
    assert sorted(listed) == sorted(get_command(command_line.app).commands)
    assert {"run", "run-step", "simulate", "demo"} <= set(found["Fly"])


def test_a_verb_with_a_new_heading_or_none_comes_last(monkeypatch: pytest.MonkeyPatch) -> None:
    app = typer.Typer(cls=command_line.Verbs, rich_markup_mode=None)
    for name, panel in (("zeta", "Model"), ("lab", "Our lab"), ("fast", "Fly"), ("alpha", None)):
        app.command(name, **({"rich_help_panel": panel} if panel else {}))(lambda: None)
    text = CliRunner().invoke(app, ["--help"]).output
    assert headings(text) == {
        "Fly": ["fast"], "Model": ["zeta"], "Our lab": ["lab"], "More": ["alpha"],
    }  # fmt: skip


@pytest.mark.parametrize("verb", sorted(get_command(command_line.app).commands))
def test_the_help_of_every_verb_has_an_example(verb: str) -> None:
    text = " ".join(heli3dof(verb, "--help").out.partition("\n")[2].split())
    assert f"heli3dof {verb}" in text


def test_the_version_is_that_of_the_package() -> None:
    assert heli3dof("--version").out == f"heli3dof {version('heli3dof')}\n"


def test_each_verb_is_a_file_of_its_own() -> None:
    files = {p.stem for p in Path(cli.__path__[0]).glob("*.py")}
    for name in get_command(command_line.app).commands:
        assert {"import": "import_log"}.get(name, name.replace("-", "_")) in files


def plug_in_verb(app: typer.Typer) -> None:
    @app.command("hello")
    def hello() -> None:
        """Greet."""


def plug_in_run(app: typer.Typer) -> None:
    app.command("run")(plug_in_verb)
    app.command("other")(plug_in_verb)


def test_verbs_of_other_packages_are_registered_and_a_broken_one_is_a_warning(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    points = [
        EntryPoint("ends", "sys:exit", command_line.GROUP),
        EntryPoint("hello", f"{__name__}:plug_in_verb", command_line.GROUP),
        EntryPoint("again", f"{__name__}:plug_in_run", command_line.GROUP),
        EntryPoint("broken", "no_such_package:register", command_line.GROUP),
    ]
    app = typer.Typer(cls=command_line.Verbs)
    monkeypatch.setattr(command_line, "app", app)
    monkeypatch.setattr(plugins, "entry_points", lambda group: points)
    command_line._register_all()
    commands = get_command(app).commands
    assert "hello" in commands
    assert commands["run"].callback.__module__ == "heli3dof.cli.run"
    assert "other" not in commands
    assert "there is a verb 'run' already" in caplog.text
    assert "the verb ends (sys:exit) does not load" in caplog.text
    assert "the verb broken (no_such_package:register) does not load" in caplog.text


@pytest.mark.parametrize("words", [["estop", "--device", "mock:"], ["--help"]])
def test_verbs_that_must_be_quick_import_nothing_heavy(words: list[str]) -> None:
    code = RUN.format(words=words) + PRINT.format(heavy=HEAVY)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_estop_without_typer_accepts_typers_options() -> None:
    options = {o for p in get_command(command_line.app).commands["estop"].params for o in p.opts}
    assert options == {"--device", "--reason", "--json", "--quiet"}
    assert list(inspect.signature(estop).parameters) == ["device", "reason", "as_json", "quiet"]


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("--device", "fake://1"),
        ("--device=fake://1", "--quiet"),
        ("--device", "fake://1", "--reason", "it smells", "--json"),
    ],
)
def test_estop_without_typer_stops_the_rig(
    words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    driver = FakeDriver()
    only_drivers(monkeypatch, fake=driver)
    with pytest.raises(SystemExit) as end:
        estop_without_typer(words)
    assert end.value.code == 0
    assert driver.stops == ["fake://1"]


def test_estop_without_typer_exits_with_the_code_of_the_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    only_drivers(monkeypatch, fake=FakeDriver(urls=()))
    with pytest.raises(SystemExit) as end:
        estop_without_typer([])
    assert end.value.code == 3


@pytest.mark.parametrize("words", [("--help",), ("--device",), ("mock:",), ("--unknown",)])
def test_estop_leaves_other_words_to_typer(words: tuple[str, ...]) -> None:
    estop_without_typer(words)


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (("run-step", "--roll", "abc"), "Invalid value for '--roll'"),
        (("run", "--bogus"), "No such option: --bogus"),
        (("info",), "Missing argument 'REC'"),
        (("monitor", "--seconds", "-1"), "Invalid value for '--seconds'"),
        (("nosuchverb",), "No such command 'nosuchverb'"),
        (("batch", "identify"), "Missing argument 'REC...'"),
    ],
)
def test_an_error_of_the_option_parser_is_a_json_document(
    words: tuple[str, ...], error: str
) -> None:
    plain, as_json = heli3dof(*words), heli3dof(*words, "--json")
    assert (plain.code, plain.out, as_json.code) == (2, "", 2)
    assert error in plain.err
    assert error in as_json.err
    document = as_json.document
    assert (document["schema"], document["exit_code"]) == ("heli3dof.error/1", 2)
    assert document["error"].startswith(error)
    assert document["fix"].endswith("--help")


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (("run-step", "10"), "Example: heli3dof run-step --roll 10\n"),
        (("run-step", "--roll", "10,5"), "A number has a decimal point and no unit.\n"),
        (("run", "--bogus"), "Example: heli3dof run steps\n"),
        (("--quiet", "run-step"), "Options follow the verb: heli3dof run-step --help"),
        (("convert",), "Did you mean 'export' or 'import'?"),
        (("dignose",), "Did you mean 'diagnose'?"),
    ],
)
def test_an_error_of_the_option_parser_has_a_hint(words: tuple[str, ...], hint: str) -> None:
    assert hint in heli3dof(*words).err


def test_a_verb_that_resembles_none_gets_no_guess() -> None:
    assert "Did you mean" not in heli3dof("next").err


def test_an_interrupted_command_prints_a_json_document(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("heli3dof.recording.info.read_with_info", interrupt)
    result = heli3dof("info", "rec.mcap", "--json")
    assert (result.code, result.err) == (130, "Warning: stopped with Ctrl-C\n")
    assert (result.document["schema"], result.document["exit_code"]) == ("heli3dof.error/1", 130)
    assert result.document["error"] == "The command was stopped with Ctrl-C."
    assert heli3dof("info", "rec.mcap").out == ""


AT_IMPORT = """
import os, runpy, signal, sys
class Send:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.{number})
sys.meta_path.insert(0, Send())
sys.argv = ["heli3dof", "run", "rich", "--json", "--dry-run"]
runpy.run_module("heli3dof", run_name="__main__")
"""


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize(
    "module", ["typer", "heli3dof.cli.run", "heli3dof.experiment.plan", "numpy"]
)
def test_a_signal_while_modules_are_imported_interrupts_the_command(
    module: str, number: str
) -> None:
    code = AT_IMPORT.format(module=module, number=number)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    why = {
        "SIGINT": "stopped with Ctrl-C", "SIGTERM": "stopped by a request to terminate (SIGTERM)",
    }[number]  # fmt: skip
    assert (done.returncode, done.stderr) == (130, f"Warning: {why}\n")
    assert json.loads(done.stdout)["exit_code"] == 130


def test_a_renamed_option_is_accepted_with_a_warning_that_names_the_new_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    only_drivers(monkeypatch, fake=FakeDriver())
    former, present = (
        heli3dof("devices", "--ask", "--json"),
        heli3dof("devices", "--probe", "--json"),
    )
    assert former.code == 0
    assert former.document["rigs"] == present.document["rigs"]
    assert "Warning: --ask is now --probe" in former.err
    assert "Warning" not in present.err


@pytest.mark.parametrize("words", [("--budget", "0.1"), ("--budget=0.1",)])
def test_a_renamed_option_keeps_its_value(words: tuple[str, ...], tmp_path: Path) -> None:
    result = heli3dof("run", "rich", "--auto", *words, "-o", tmp_path / "auto")
    assert result.code == 2
    assert "more than the budget of 0.1 min" in result.err
    assert "--budget is now --budget-min" in result.err


@pytest.mark.parametrize(("verb", "former"), [("devices", "--ask "), ("run", "--budget ")])
def test_the_help_does_not_list_a_former_name(verb: str, former: str) -> None:
    assert former not in heli3dof(verb, "--help").out
