"""The wheel holds every package of the tree."""

from __future__ import annotations

import tomllib

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
