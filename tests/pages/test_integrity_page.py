"""docs/explanation/diagnosis.md lists every integrity check."""

from __future__ import annotations

import ast
import re

from heli3dof.integrity import checks
from tests.pages.integrity_page import PAGE
from tests.paths import ROOT

NAME = re.compile(r"[a-z]+\.[a-z_]+")
MAKES_A_FAULT = {"Fault", "_fault", "bad_data_fault"}


def reported() -> dict[str, set[str]]:
    """The names of faults in the code that makes them, by file: their first word with a dot."""
    out: dict[str, set[str]] = {}
    files = [*(ROOT / "heli3dof/integrity").glob("*.py"), ROOT / "heli3dof/cli/diagnose.py"]
    for path in files:
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(call, ast.Call) and ast.unparse(call.func) in MAKES_A_FAULT:
                texts = [a.value for a in call.args[:2] if isinstance(a, ast.Constant)]
                names = {t for t in texts if isinstance(t, str) and NAME.fullmatch(t)}
                out[path.stem] = out.get(path.stem, set()) | names
    return out


def test_every_check_has_another_name() -> None:
    names = [c.name for c in checks()]
    assert len(set(names)) == len(names)


def test_every_fault_that_the_code_reports_is_in_the_docs() -> None:
    names = set().union(*reported().values())
    assert {"timing.hole", "encoder.sign", "log.refused"} < names
    assert {n for n in names if f"`{n}`" not in PAGE.read()} == set()


def test_every_check_declares_the_faults_of_its_file() -> None:
    found = reported()
    del found["diagnose"]
    declared: dict[str, set[str]] = {}
    for c in checks():
        file = c.run.__module__.rpartition(".")[2]
        declared[file] = declared.get(file, set()) | set(c.faults or (c.name,))
    assert declared == {file: names for file, names in found.items() if names}
