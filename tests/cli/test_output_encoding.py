"""Every verb prints its whole output in any encoding of stdout and stderr."""

from __future__ import annotations

import io
import itertools
import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from heli3dof.cli import app
from heli3dof.cli.output_encoding import is_ascii_or_utf, printable
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import step_plan

ENCODINGS = ("ascii", "cp1252", "cp437", "latin-1", "utf-8")
Shell = Callable[..., tuple[int, bytes, bytes]]


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Shell:
    """Run the program with output redirected in an encoding; return (code, out, err)."""
    monkeypatch.chdir(tmp_path)

    def run(encoding: str, *words: object) -> tuple[int, bytes, bytes]:
        streams = [io.TextIOWrapper(io.BytesIO(), encoding=encoding) for _ in range(2)]
        with monkeypatch.context() as patched:
            patched.setattr(sys, "argv", ["heli3dof", *map(str, words)])
            patched.setattr(sys, "stdout", streams[0])
            patched.setattr(sys, "stderr", streams[1])
            with pytest.raises(SystemExit) as ended:
                app.main()
        out, err = (stream.detach().getvalue() for stream in streams)
        return int(ended.value.code or 0), out, err

    return run


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("flight") / "größe ψ.mcap"
    plan = step_plan((5.0, None, None), settle_s=2, duration_s=1)
    fly_plan(plan, device="mock:?speed=max", output=path)
    return path


WORDS = [
    ("--help",),
    ("diagnose", "--help"),
    ("devices",),
    ("monitor", "--device", "mock:", "--seconds", "0"),
    ("zero", "--device", "mock:", "--dry-run"),
    ("estop",),
    ("run", "rich", "--dry-run"),
    ("run-step", "--roll", "5", "--settle", "2", "--duration", "1", "--device", "mock:?speed=max"),
    ("run-step", "--roll", "400"),
    ("simulate", "steps", "--model", "hover", "-o", "ψ.mcap"),
    ("info", "FLIGHT"),
    ("export", "FLIGHT", "-o", "ψ.csv"),
    ("diagnose", "ψ.mcap"),
    ("identify", "ψ.mcap"),
]
SLOW = [
    ("doctor", "--device", "mock:"),
    ("compare", "FLIGHT", "-o", "ψ"),
    ("report", "FLIGHT", "-o", "ψ.html"),
]
"""Verbs that take seconds are run in ASCII only, which replaces the most symbols."""


@pytest.mark.parametrize(
    ("words", "encoding"),
    [
        *itertools.product(WORDS, ("ascii", "cp437", "utf-8")),
        *((words, "ascii") for words in SLOW),
    ],
    ids=lambda x: x if isinstance(x, str) else " ".join(x[:2]),
)
def test_every_verb_prints_in_every_encoding(
    words: tuple[str, ...], encoding: str, shell: Shell, flight: Path
) -> None:
    code, out, err = shell(encoding, *(flight if w == "FLIGHT" else w for w in words))
    assert code in (0, 2, 3, 5, 6), err.decode(encoding)
    result = (out + err).decode(encoding)
    assert result.strip()
    assert "internal error" not in result
    assert "Traceback" not in result
    assert "\N{REPLACEMENT CHARACTER}" not in result


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_the_one_json_document_is_the_same_in_every_encoding(
    encoding: str, shell: Shell, flight: Path
) -> None:
    code, out, _ = shell(encoding, "info", flight, "--json")
    assert code == 0
    assert json.loads(out)["file"] == str(flight)
    assert encoding == "utf-8" or out.isascii(), "also valid UTF-8, which JSON requires"


def test_a_table_in_ascii_keeps_its_columns(shell: Shell, flight: Path) -> None:
    _, out, _ = shell("ascii", "info", flight)
    table, _, _ = out.decode("ascii").partition("Steps of the reference")
    lines = table.rstrip().splitlines()
    assert "deg to" in table
    assert len({len(line) for line in lines}) == 1


def test_a_file_name_that_is_not_unicode_is_printed_and_valid_json(shell: Shell) -> None:
    code, _, err = shell("utf-8", "info", "\udcff.mcap")
    assert code == 5
    assert rb"\xff.mcap" in err
    code, out, _ = shell("utf-8", "info", "\udcff.mcap", "--json")
    assert code == 5
    assert "\udcff.mcap" in json.loads(out)["error"]


@pytest.mark.parametrize(
    ("text", "ascii_only"),
    [
        ("−3 °/s ± 2 µs", "-3 deg/s +/- 2 us"),
        ("kg·m² s⁻¹ χ²", "kg.m^2 s^-1 chi^2"),
        ("ψ → Δθ …", "psi -> Deltatheta ..."),
        ("Größe é ½", "Grosse e 1/2"),
        ("日 \udcff", r"\u65e5 \xff"),
    ],
)
def test_symbols_are_replaced_by_ascii_text(text: str, ascii_only: str) -> None:
    assert printable(text, "ascii") == ascii_only


def test_characters_of_the_encoding_are_kept() -> None:
    assert printable("5 ° ≤ ψ", "cp1252") == "5 ° <= psi"
    assert printable("5 ° ≤ ψ", "utf-8") == "5 ° ≤ ψ"
    assert is_ascii_or_utf("ψ", "UTF-8")
    assert not is_ascii_or_utf("°", "latin-1"), "a Unicode stream, or ASCII"
