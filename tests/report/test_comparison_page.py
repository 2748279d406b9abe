from __future__ import annotations

from tests.report.comparison_page import PAGE, renewed


def test_the_published_table_in_the_docs_is_current() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert renewed(page) == page, "run: python -m tests.report.comparison_page"
