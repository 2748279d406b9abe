"""docs/explanation/paper.md holds only numbers that are computed, quoted, or shown by a test."""

from __future__ import annotations

import re

from tests.pages import paper_page
from tests.paths import ROOT

PAGE = paper_page.PAGE.read()
PROSE = re.sub(r"<!-- (\w+): made by .*?<!-- end of \1 -->", "", PAGE, flags=re.S)


def test_decimals_outside_the_computed_tables_are_the_papers_own() -> None:
    quoted = {"2.52", "0.05", "0.1"}  # E14's reading; Q and R of the design
    result = set(re.findall(r"(?<![\w.])\d+\.\d+", PROSE))
    assert result <= quoted


def test_every_erratum_but_two_has_a_test() -> None:
    tests = (ROOT / "tests" / "model" / "test_errata.py").read_text(encoding="utf-8")
    tested = {int(number) for number in re.findall(r"def test_e(\d+)_", tests)}
    assert tested == set(range(1, 16)) - {9, 15}


def test_the_page_has_all_fifteen_errata() -> None:
    for i in range(1, 16):
        assert f"| E{i} |" in PAGE
