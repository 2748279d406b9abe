"""Pages with computed blocks."""

from __future__ import annotations

import pytest

from tests.pages.page import COMMAND, Page
from tests.pages.pages import PAGES

BEGIN, END = f"<!-- one: made by {COMMAND} -->", "<!-- end of one -->"
TEXT = f"before\n{BEGIN}\nold\n{END}\nafter\n"


@pytest.mark.parametrize(
    "page",
    [pytest.param(p, marks=[pytest.mark.accuracy] * p.slow, id=p.file) for p in PAGES],
)
def test_a_committed_page_equals_what_the_code_computes(page: Page) -> None:
    text = page.read()
    assert page.renewed(text) == text, f"run: {COMMAND}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.file)
def test_every_marker_on_a_page_has_its_function(page: Page) -> None:
    assert page.read().count(f"made by {COMMAND} -->") == len(page.blocks)


def test_only_the_text_between_the_markers_changes() -> None:
    page = Page("docs/x.md", {"one": lambda: "new"})
    renewed = page.renewed(TEXT)
    assert renewed == TEXT.replace("old", "new")
    assert page.renewed(renewed) == renewed


@pytest.mark.parametrize("lost", [BEGIN, END])
def test_a_missing_marker_is_an_error(lost: str) -> None:
    with pytest.raises(ValueError, match=r"docs/x.md has no <!-- one"):
        Page("docs/x.md", {"one": lambda: "new"}).renewed(TEXT.replace(lost, ""))
