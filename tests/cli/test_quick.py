"""What is typed in a hurry is read as typer would read it, or left to typer."""

from __future__ import annotations

import inspect
import subprocess
import sys

import pytest
from typer.main import get_command

from heli3dof.cli import app as command_line
from tests.rig.fakes import FakeDriver, only_drivers

LOADED = "import sys; from heli3dof.cli.app import main; sys.argv = ['heli3dof', *{words}]\n"
ASKED = "try: main()\nexcept SystemExit: pass\nprint('pydantic' in sys.modules)"


@pytest.mark.parametrize("verb", command_line.QUICK)
def test_its_options_are_typers(verb: str) -> None:
    function, flags, values = command_line.QUICK[verb]
    known = {
        option: (parameter.name, parameter.is_flag)
        for parameter in get_command(command_line.app).commands[verb].params
        for option in parameter.opts
    }
    for option, name in (flags | values).items():
        assert known[option] == (name, option in flags)
        assert name in inspect.signature(function).parameters


@pytest.mark.parametrize(
    ("words", "device", "code"),
    [
        ((), None, 0),
        (("--device", "fake://1"), "fake://1", 0),
        (("--device=fake://1", "--quiet"), "fake://1", 0),
        (("--device", "fake://1", "--reason", "it smells"), "fake://1", 0),
    ],
)
def test_estop_is_carried_out(
    words: tuple[str, ...], device: str | None, code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver = FakeDriver()
    only_drivers(monkeypatch, fake=driver)
    with pytest.raises(SystemExit) as end:
        command_line.without_delay(["estop", *words])
    assert end.value.code == code
    assert driver.stops == ["fake://1"]


def test_its_exit_code_is_the_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    only_drivers(monkeypatch, fake=FakeDriver(urls=()))
    with pytest.raises(SystemExit) as end:
        command_line.without_delay(["estop"])
    assert end.value.code == 3


@pytest.mark.parametrize(
    "words",
    [(), ("run",), ("estop", "--help"), ("estop", "--device"), ("estop", "--device", "--json"),
     ("estop", "mock:"), ("devices", "--profile", "x.toml")],
)  # fmt: skip
def test_all_else_is_left_to_typer(words: tuple[str, ...]) -> None:
    command_line.without_delay(words)


@pytest.mark.parametrize("words", [["estop", "--device", "mock:"], ["devices", "--quiet"]])
def test_no_validator_is_loaded(words: list[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-c", LOADED.format(words=words) + ASKED],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.splitlines()[-1] == "False"
