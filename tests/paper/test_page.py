"""docs/paper.md says only what is computed, quoted, or shown by a test."""

from __future__ import annotations

import re

from heli3dof.paper.page import BLOCKS, regenerate
from tests.paths import ROOT

PAGE = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
COMPUTED = re.findall(r"<!-- computed: (\w+) -->\n(.*?)<!-- end -->", PAGE, flags=re.S)
PROSE = re.sub(r"<!-- computed: .*?<!-- end -->", "", PAGE, flags=re.S)


def test_the_computed_tables_are_what_is_computed_now() -> None:
    assert regenerate(PAGE) == PAGE, (
        "python -m heli3dof.paper.page docs/paper.md makes the tables anew"
    )


def test_every_block_is_on_the_page() -> None:
    assert sorted(name for name, _ in COMPUTED) == sorted(BLOCKS)


def test_decimals_outside_the_computed_tables_are_the_papers_own() -> None:
    quoted = {"2.52", "0.05", "0.1"}  # E14's reading; Q and R of the design
    found = set(re.findall(r"(?<![\w.])\d+\.\d+", PROSE))
    assert found <= quoted


def test_every_test_that_the_page_names_exists() -> None:
    tests = "".join(p.read_text(encoding="utf-8") for p in (ROOT / "tests").rglob("test_*.py"))
    named = set(re.findall(r"`(test_\w+)`", PAGE))
    assert len(named) >= 18
    for name in named:
        assert f"def {name}(" in tests, name


def test_each_of_the_fifteen_errata_stands_on_the_page() -> None:
    for i in range(1, 16):
        assert f"| E{i} |" in PAGE
