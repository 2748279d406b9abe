"""Links, verbs and options in the documentation exist."""

from __future__ import annotations

import re

import pytest

from heli3dof.cli.app import app
from tests.paths import ROOT

PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_every_link_to_a_file_has_a_target(page) -> None:
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8")):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


def verbs() -> set[str]:
    named = [c.name for c in (*app.registered_commands, *app.registered_groups)]
    return {name for name in named if isinstance(name, str)}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_every_command_on_a_page_is_a_verb(page) -> None:
    text = page.read_text(encoding="utf-8")
    code = [*re.findall(r"```.*?```", text, re.DOTALL), *re.findall(r"`[^`\n]+`", text)]
    shown = re.findall(r"(?:^|`)heli3dof ([a-z][a-z-]+)", "\n".join(code), re.MULTILINE)
    assert set(shown) <= verbs()


def test_the_readme_names_every_verb() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for verb in verbs():
        assert f"`{verb}" in text, verb
