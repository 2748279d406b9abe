"""Dependencies point one way: cli → the verbs' packages → model, recording, rig → numpy."""

from __future__ import annotations

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

# Each package may import itself, libraries, and the packages in its row.
MAY_IMPORT = {
    "errors": set(),
    "write_errors": {"errors"},
    "arguments": {"errors", "rig", "recording", "model", "experiment", "paper"},
    "file_kind": {"errors"},
    "axes": set(),
    "effect_names": {"axes"},
    "arrays": set(),
    "distributions": set(),
    "toml_file": {"errors", "file_kind"},
    "parallel": set(),
    "plugins": {"errors"},
    "stage_clock": set(),
    "json_values": set(),
    "results": {"errors"},
    "rig": {"errors", "file_kind", "arrays", "axes", "plugins", "toml_file", "write_errors"},
    "recording": {
        "errors", "file_kind", "results", "arrays", "axes", "distributions", "plugins", "rig",
        "write_errors",
    },
    "model": {
        "errors", "file_kind", "json_values", "arrays", "axes", "effect_names", "plugins", "rig",
        "recording",
    },
    "experiment": {
        "errors", "arrays", "axes", "plugins", "toml_file", "rig", "recording", "model",
    },
    "exercise": {"errors", "axes", "rig", "model"},
    "identification": {
        "errors", "file_kind", "json_values", "results", "arrays", "axes", "distributions",
        "parallel", "plugins", "stage_clock", "rig", "recording", "model",
    },
    "effect_files": {
        "errors", "file_kind", "axes", "effect_names", "plugins", "rig", "model",
        "identification",
    },
    "comparison": {
        "errors", "json_values", "results", "arrays", "axes", "rig", "recording", "model",
        "identification",
    },
    "fleet": {"errors", "json_values", "results", "arrays", "batch"},
    "paper": {"errors", "file_kind", "axes", "rig", "recording", "model", "comparison"},
    "integrity": {"errors", "axes", "plugins", "rig", "recording", "model", "identification"},
    "diagnosis": {
        "errors", "results", "arrays", "axes", "distributions", "parallel", "stage_clock", "rig",
        "recording", "model", "experiment", "identification", "comparison", "integrity",
    },
    "batch": {
        "errors", "file_kind", "json_values", "results", "axes", "parallel", "toml_file",
        "write_errors", "rig", "recording", "model", "experiment", "identification", "comparison",
        "integrity", "diagnosis", "paper",
    },
    "report": {
        "errors", "axes", "rig", "recording", "model", "experiment", "identification",
        "comparison", "diagnosis", "fleet", "paper",
    },
    "cli": {
        "errors", "json_values", "axes", "write_errors", "rig", "recording", "model", "experiment",
        "exercise", "identification", "comparison", "integrity", "diagnosis", "fleet", "report",
        "toml_file", "paper", "plugins", "batch", "effect_files",
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


@pytest.mark.parametrize("package", sorted(MAY_IMPORT))
def test_no_modules_of_a_package_import_one_another_in_a_circle(package: str) -> None:
    """Imports inside functions count, those for type checking do not."""
    modules = {_module(path): path for path in files(package)}
    edges = {name: _edges(path) & set(modules) - {name} for name, path in modules.items()}
    TopologicalSorter(edges).prepare()  # raises CycleError with the circle


@pytest.mark.parametrize("package", ["diagnosis", "report"])
def test_no_folders_of_a_package_import_one_another_in_a_circle(package: str) -> None:
    """Modules at the top of the package count as folders of their own."""
    modules = {_module(path): path for path in files(package)}
    edges: dict[str, set[str]] = {}
    for name, path in modules.items():
        folder = _folder(name)
        edges.setdefault(folder, set()).update(
            {_folder(other) for other in _edges(path) & set(modules)} - {folder}
        )
    TopologicalSorter(edges).prepare()


def _folder(module: str) -> str:
    return ".".join(module.split(".")[:3])


def _module(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _edges(path: Path) -> set[str]:
    """Modules or names that a file imports at run time, and the modules of the names."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            node.body = []
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {a.name for a in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            own = {f"{node.module}.{a.name}" for a in node.names}
            submodules = {n for n in own if _is_module(n)}
            names |= submodules or {node.module}
    return names


def _is_module(name: str) -> bool:
    path = ROOT / Path(*name.split("."))
    return path.with_suffix(".py").exists() or (path / "__init__.py").exists()


def test_every_package_is_in_the_table() -> None:
    result = {
        p.stem if p.is_file() else p.name
        for p in (ROOT / "heli3dof").iterdir()
        if p.suffix == ".py" or (p / "__init__.py").exists()
        if not p.name.startswith("__")
    }
    assert result == set(MAY_IMPORT)


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
