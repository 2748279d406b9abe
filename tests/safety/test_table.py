"""Every row of docs/reference/safety.md has its test."""

from __future__ import annotations

import ast
from pathlib import Path

from tests.safety.table import ROWS


def shown_here() -> set[str]:
    """Names of the test functions in this folder, without ``test_``."""
    return {
        node.name.removeprefix("test_")
        for path in Path(__file__).parent.glob("test_*.py")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    }


def test_every_row_has_its_test() -> None:
    assert {row.name for row in ROWS} <= shown_here()


def test_no_row_stands_twice() -> None:
    assert len({row.name for row in ROWS}) == len(ROWS) == len({row.what for row in ROWS})
