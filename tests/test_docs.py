"""Links, verbs and options in the documentation exist."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import json
import re
import textwrap

import pytest

import heli3dof as h3
from heli3dof.cli.app import app
from heli3dof.model.greybox.model import nominal
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


def promised_verbs() -> set[str]:
    """Returns the verbs in the first table of the contract."""
    text = (ROOT / "docs" / "reference" / "contract.md").read_text(encoding="utf-8")
    rows = text[text.index("| verb |") :].split("\n\n")[0].splitlines()
    cells = [row.split("|")[1] for row in rows[2:]]
    return {verb for cell in cells for verb in re.findall(r"`(?:heli3dof )?([a-z][a-z-]+)", cell)}


def test_the_contract_promises_only_verbs_that_exist() -> None:
    assert {"demo", "run-step", "import", "recover"} <= promised_verbs() <= verbs()


def test_the_readme_names_every_verb_of_the_contract() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for verb in promised_verbs():
        assert f"`{verb}" in text, verb


def test_the_readmes_numbers_are_those_of_the_benchmarks() -> None:
    stored = json.loads((ROOT / "docs/results/benchmarks.json").read_text(encoding="utf-8"))
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    figures = {f["what"]: f for name in ("hidden", "kill") for f in stored[name]["figures"]}
    right = figures["right cause first, rich plan, medium and large"]
    share, _, flights = counts(right["value"])
    assert f"In **{share} %** of {flights} flights of the plan `rich` with one" in text
    assert f"({right['how']})" in text
    alarms = [counts(f["value"]) for what, f in figures.items() if what.startswith("false alarms")]
    false, quiet = sum(int(k) for _, k, _ in alarms), sum(int(n) for *_, n in alarms)
    assert f"In **{false} of {quiet}** flights without a hidden effect" in text
    worst = figures["kill -9: last command to zero volts, worst"]["value"]
    assert f"within **{worst}** of the last command" in text


def test_the_readmes_example_prints_the_identified_parameters() -> None:
    """`summary` prints each parameter with its standard deviation, `sentences` prints none."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert example.rstrip().endswith("print(model.summary())")


def counts(value: str) -> tuple[str, str, str]:
    """Return (share, k, n) of a figure's value such as ``98.3 % (59/60)``."""
    found = re.fullmatch(r"([\d.]+) % \((\d+)/(\d+)\)", value)
    assert found is not None
    return found[1], found[2], found[3]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_every_name_that_an_example_imports_exists(page) -> None:
    for block in re.findall(
        r"^ *```python\n(.*?)```", page.read_text(encoding="utf-8"), re.M | re.S
    ):
        for node in ast.walk(ast.parse(textwrap.dedent(block))):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("heli3dof"):
                module = importlib.import_module(str(node.module))
                for alias in node.names:
                    whole = f"{node.module}.{alias.name}"
                    assert hasattr(module, alias.name) or importlib.util.find_spec(whole), whole


@pytest.mark.parametrize("kind", ["greybox", "hover"])
def test_the_example_of_a_model_file_runs_for_every_kind_of_model(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    profile = h3.default_profile()
    h3.save_model(nominal(profile) if kind == "greybox" else h3.hover_model(profile), "fit.json")
    text = (ROOT / "docs/reference/model-file.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    exec(example, variables := {})
    assert (tmp_path / "copy.json").exists()
    assert variables["angle"][0] == pytest.approx(0.17, abs=0.01)  # its controller's set value
