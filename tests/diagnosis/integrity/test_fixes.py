"""What a check tells people to do can be done: the verbs that it names exist."""

from __future__ import annotations

import ast
import re

from heli3dof.cli.app import app
from tests.paths import ROOT

FOLDER = ROOT / "heli3dof" / "diagnosis" / "integrity"


def advice() -> list[str]:
    """Every text of the package that is no docstring."""
    said = []
    for path in FOLDER.glob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        bare = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
        said += [
            n.value
            for n in ast.walk(tree)
            if isinstance(n, ast.Constant) and isinstance(n.value, str) and id(n) not in bare
        ]
    return said


def test_every_verb_that_a_remedy_names_exists() -> None:
    verbs = {c.name for c in app.registered_commands}
    named = {v for text in advice() for v in re.findall(r"heli3dof ([a-z][a-z-]*)", text)}
    assert "run-step" in named
    assert named <= verbs
