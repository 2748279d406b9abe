"""The commands of the tutorials and of the example run, and print what the pages show."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs.site import in_site
from tests.docs.tutorial import difference, run, steps
from tests.paths import ROOT

TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
PAGES = [*TUTORIALS, ROOT / "docs" / "explanation" / "diagnosis.md"]


@pytest.mark.tutorial
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_commands_of_a_page_print_what_it_shows(page: Path, tmp_path: Path) -> None:
    for step in steps(page.read_text(encoding="utf-8")):
        printed = run(step.commands, tmp_path)
        assert difference(step.shown or "", printed) == "", printed


def test_every_such_page_shows_output() -> None:
    for page in PAGES:
        assert any(step.shown for step in steps(page.read_text(encoding="utf-8"))), page


def test_a_link_of_a_page_outside_docs_leads_to_its_page_in_the_site() -> None:
    assert in_site("[a](docs/how-to/quanser.md#x)", "overview.md") == "[a](how-to/quanser.md#x)"
    assert in_site("[a](../../CONTRIBUTING.md)", "how-to/quanser.md") == "[a](../contributing.md)"
    assert in_site("[a](../../heli3dof/rig)", "reference/safety.md") == "a"


def test_another_number_is_a_difference() -> None:
    assert difference("RMSE 1.48°", "RMSE 1.60°") == "RMSE 1.48°"
    assert difference("RMSE 1.48°", "RMSE 1.47°") == ""


def test_a_missing_line_is_a_difference() -> None:
    assert difference("first\n…\nlast", "first\nmiddle") == "last"


def test_a_block_of_text_belongs_to_the_commands_before_it() -> None:
    page = "```sh\na\n```\n\n```text\nA\n```\n\n```sh\nb\n```\n"
    assert [(s.commands, s.shown) for s in steps(page)] == [("a\n", "A\n"), ("b\n", None)]
