"""The wheel holds every package of the tree."""

from __future__ import annotations

import subprocess
import tomllib
from pathlib import Path

import pytest

from tests.paths import ROOT


def test_pyproject_lists_every_package() -> None:
    data = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    mapped = {v: k for k, v in data["tool"]["setuptools"]["package-dir"].items()}
    result = set()
    for top in ("heli3dof", *mapped):
        for init in (ROOT / top).rglob("__init__.py"):
            parts = init.parent.relative_to(ROOT).parts
            result.add(".".join([mapped.get(parts[0], parts[0]), *parts[1:]]))
    assert set(data["tool"]["setuptools"]["packages"]) == result


def test_the_top_level_holds_no_output_of_the_tool() -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        pytest.skip("not a git checkout")
    top = {name for name in listed.stdout.splitlines() if "/" not in name}
    written = {name for name in top if Path(name).suffix in {".json", ".mcap", ".html", ".csv"}}
    assert not written
