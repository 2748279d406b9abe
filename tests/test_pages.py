"""Pages whose tables are made by code."""

from __future__ import annotations

import pytest

from heli3dof.pages import Page

TEXT = """before
<!-- one: made by python -m here -->
old
<!-- end of one -->
after
"""


def test_only_what_stands_between_the_markers_is_made_anew() -> None:
    page = Page("here", {"one": lambda: "new"})
    renewed = page.renewed(TEXT)
    assert renewed == TEXT.replace("old", "new")
    assert page.renewed(renewed) == renewed


@pytest.mark.parametrize("lost", ["<!-- one: made by python -m here -->", "<!-- end of one -->"])
def test_a_lost_marker_is_told_and_no_text_is_lost(lost: str) -> None:
    with pytest.raises(ValueError, match="has no <!-- one"):
        Page("here", {"one": lambda: "new"}).renewed(TEXT.replace(lost, ""))
