"""The commands that the checks' advice names exist."""

from __future__ import annotations

import ast
import re

from heli3dof.cli.app import app
from tests.paths import ROOT

FOLDER = ROOT / "heli3dof" / "integrity"


def advice() -> list[str]:
    """Return the string constants of the package that are not docstrings."""
    texts = []
    for path in FOLDER.glob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        bare = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
        texts += [
            n.value
            for n in ast.walk(tree)
            if isinstance(n, ast.Constant) and isinstance(n.value, str) and id(n) not in bare
        ]
    return texts


def test_every_command_in_the_advice_exists() -> None:
    verbs = {c.name for c in app.registered_commands}
    named = {v for text in advice() for v in re.findall(r"heli3dof ([a-z][a-z-]*)", text)}
    assert "run-step" in named
    assert named <= verbs


def test_no_advice_is_to_do_nothing() -> None:
    assert not any("nothing to do" in text for text in advice())


def test_no_advice_starts_a_flight_while_hands_are_on_the_rig() -> None:
    by_hand = [text for text in advice() if "by hand" in text]
    assert by_hand
    assert not any("heli3dof run" in text for text in by_hand)
