"""Dependencies point one way: cli → the verbs' packages → model, recording, rig → numpy."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

# Each package may import itself and what stands in its row, besides libraries.
MAY_IMPORT = {
    "errors": set(),
    "write_errors": {"errors"},
    "axes": set(),
    "toml_file": {"errors"},
    "pages": set(),
    "parallel": set(),
    "rig": {"errors", "axes", "pages", "toml_file", "write_errors"},
    "recording": {"errors", "axes", "rig", "write_errors"},
    "model": {"errors", "axes", "pages", "rig", "recording"},
    "experiment": {"errors", "axes", "pages", "toml_file", "rig", "recording", "model"},
    "identification": {"errors", "axes", "parallel", "rig", "recording", "model"},
    "comparison": {"errors", "axes", "rig", "recording", "model"},
    "paper": {"errors", "axes", "pages", "rig", "recording", "model", "comparison"},
    "diagnosis": {
        "errors", "axes", "pages", "parallel", "rig", "recording", "model", "experiment",
        "identification", "comparison",
    },
    "report": {
        "errors", "axes", "rig", "recording", "model", "identification", "comparison", "diagnosis",
        "paper",
    },
    "cli": {
        "errors", "axes", "write_errors", "rig", "recording", "model", "experiment",
        "identification", "comparison", "diagnosis", "report", "toml_file", "paper",
    },
}  # fmt: skip


def imports_of(path: Path) -> set[str]:
    """Absolute names of everything a file imports, wherever in the file."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {a.name for a in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            assert node.module is not None
            names |= {f"{node.module}.{a.name}" for a in node.names}
    return names


def files(package: str) -> list[Path]:
    folder = ROOT / "heli3dof" / package
    return sorted(folder.rglob("*.py")) if folder.is_dir() else [folder.with_suffix(".py")]


@pytest.mark.parametrize("package", sorted(MAY_IMPORT))
def test_each_package_imports_only_what_lies_below_it(package: str) -> None:
    allowed = MAY_IMPORT[package] | {package}
    for path in files(package):
        for name in imports_of(path):
            parts = name.split(".")
            if parts[0] == "heli3dof" and len(parts) > 1:
                assert parts[1] in allowed, f"{path.relative_to(ROOT)} imports {name}"


CIRCLES_ALLOWED = {"identification"}
"""Packages whose modules still import each other in a circle."""


def _modules() -> dict[str, Path]:
    """Dotted name → file of every module of heli3dof."""
    out = {}
    for path in sorted((ROOT / "heli3dof").rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        out[".".join(parts).removesuffix(".__init__")] = path
    return out


def circles(imports: dict[str, set[str]]) -> list[list[str]]:
    """The groups of modules that import each other, directly or through others (Tarjan)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(name: str) -> None:
        index[name] = low[name] = len(index)
        stack.append(name)
        for other in sorted(imports[name]):
            if other not in index:
                visit(other)
                low[name] = min(low[name], low[other])
            elif other in stack:
                low[name] = min(low[name], index[other])
        if low[name] == index[name]:
            at = stack.index(name)
            group = stack[at:]
            del stack[at:]
            if len(group) > 1:
                found.append(sorted(group))

    for name in imports:
        if name not in index:
            visit(name)
    return found


def module_imports() -> dict[str, set[str]]:
    """Module → the modules that it imports: at the top, in functions, and for types."""
    modules = _modules()
    out: dict[str, set[str]] = {}
    for name, path in modules.items():
        out[name] = set()
        for imported in imports_of(path):
            while imported and imported not in modules:
                imported = imported.rpartition(".")[0]
            if imported not in ("", "heli3dof", name):
                out[name].add(imported)
    return out


@pytest.mark.parametrize("package", sorted(MAY_IMPORT))
def test_no_modules_of_a_package_import_each_other_in_a_circle(package: str) -> None:
    inside = f"heli3dof.{package}"
    found = [
        group
        for group in circles(module_imports())
        if any(n == inside or n.startswith(f"{inside}.") for n in group)
    ]
    if package in CIRCLES_ALLOWED and found:
        return
    assert not found, f"import circle: {'; '.join(' ↔ '.join(group) for group in found)}"


def test_a_circle_is_found_through_other_modules() -> None:
    imports = {"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}
    assert circles(imports) == [["a", "b", "c"]]
    assert circles({"a": {"b"}, "b": set(), "d": {"a", "b"}}) == []


def test_every_package_stands_in_the_table() -> None:
    found = {
        p.stem if p.is_file() else p.name
        for p in (ROOT / "heli3dof").iterdir()
        if p.suffix == ".py" or (p / "__init__.py").exists()
        if not p.name.startswith("__")
    }
    assert found == set(MAY_IMPORT)


def test_heli3dof_never_imports_a_driver_package() -> None:
    for path in (ROOT / "heli3dof").rglob("*.py"):
        assert not any(n.startswith("heli3dof_drivers") for n in imports_of(path)), path


def test_the_emulated_plant_shares_no_code_with_the_models() -> None:
    banned = (
        "heli3dof.model",
        "heli3dof.identification",
        "heli3dof.comparison",
        "heli3dof.experiment",
    )
    for path in (ROOT / "drivers").rglob("*.py"):
        assert not any(n.startswith(banned) for n in imports_of(path)), path


def test_heavy_libraries_are_not_imported_at_the_top_of_the_command_line() -> None:
    heavy = {"numpy", "scipy", "control", "numba", "matplotlib", "mcap", "pydantic"}
    for path in files("cli"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in tree.body:
            names = set()
            if isinstance(node, ast.Import):
                names = {a.name.split(".")[0] for a in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                names = {node.module.split(".")[0]}
            assert not names & heavy, f"{path.name} imports {names & heavy} at its top"
