"""Every row of docs/reference/safety.md has a test, and the page is made from the rows."""

from __future__ import annotations

import ast
from pathlib import Path

from tests.safety.table import ROWS


def names_tested() -> set[str]:
    """Names of the test functions in this folder, without ``test_``."""
    return {
        node.name.removeprefix("test_")
        for path in Path(__file__).parent.glob("test_*.py")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    }


def test_every_row_has_a_test() -> None:
    assert {row.name for row in ROWS} <= names_tested()


def test_rows_are_unique() -> None:
    assert len({row.name for row in ROWS}) == len(ROWS) == len({row.what for row in ROWS})
