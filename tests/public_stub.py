"""``python -m tests.public_stub``: write the signatures in ``heli3dof/__init__.pyi``.

`heli3dof.arguments` converts arguments of the public functions: a path becomes a recording, a name
a plan. The functions themselves take the converted objects only, and their annotations say so.
The stub contains the signatures that users see. They are made of the functions' own signatures,
with the types of `ACCEPTED` for the parameters that are converted.
"""

from __future__ import annotations

import ast
import importlib
from pathlib import Path

STUB = Path(__file__).parents[1] / "heli3dof" / "__init__.pyi"
ONE_RECORDING = "Recording | str | Path"
ONE_MODEL = "Model | str | Path"
ACCEPTED = {
    "controller": "ControllerSpec | None",
    "dt": "float",
    "first": "Plan | str | Path",
    "holdout": f"{ONE_RECORDING} | Sequence[{ONE_RECORDING}]",
    "horizons_s": "float | Sequence[float]",
    "identified": "Identification | Sequence[Identification]",
    "intervals_s": "float | Sequence[float]",
    "model": ONE_MODEL,
    "models": f"{ONE_MODEL} | Sequence[{ONE_MODEL}] | Callable[[Recording], Sequence[Model]]",
    "plan": "Plan | str | Path",
    "profile": "Profile | str | Path",
    "recording": ONE_RECORDING,
    "recordings": f"{ONE_RECORDING} | Sequence[{ONE_RECORDING}]",
}
"""Parameter → type of the arguments that `heli3dof.arguments.CONVERSIONS` accepts for it"""
IMPORTED = {
    "Callable": "collections.abc", "ControllerSpec": ".rig.profile", "Model": ".model.base",
    "Path": "pathlib", "Sequence": "collections.abc",
}  # fmt: skip
"""Name in `ACCEPTED` that is not public → its module"""


def stub() -> str:
    """Return the content that ``heli3dof/__init__.pyi`` should have."""
    imports = [n for n in ast.parse(STUB.read_text("utf-8")).body if isinstance(n, ast.ImportFrom)]
    public = {a.name: f".{n.module}" for n in imports if n.level for a in n.names
              if a.asname in (a.name, f"_public_{a.name}")}  # fmt: skip
    lines, functions, used = [], list[str](), dict[str, str]()
    for name, module in sorted(public.items(), key=lambda item: (item[1], item[0])):
        found = _converted(name, module, public, used)
        lines.append(f"from {module} import {name} as {f'_public_{name}' if found else name}")
        functions += [found] if found else []
    others = ["import numpy as np"]
    for module in sorted({m for name, m in used.items() if name not in public}):
        names = sorted(n for n, m in used.items() if m == module and n not in public)
        others.append(f"from {module} import {', '.join(names)}")
    lines.append("__version__: str")
    return "\n".join([*sorted(others), *lines]) + "\n\n" + "\n\n".join(functions) + "\n"


def _converted(name: str, module: str, public: dict[str, str], used: dict[str, str]) -> str | None:
    """Return the stub of a function with a parameter of `ACCEPTED`; None for all other objects.

    The modules of the names in its annotations are added to ``used``.
    """
    path = Path(importlib.import_module(f"heli3dof{module}").__file__ or "")
    body = ast.parse(path.read_text("utf-8")).body
    function = next((n for n in body if isinstance(n, ast.FunctionDef) and n.name == name), None)
    if function is None:
        return None
    parameters = [*function.args.args, *function.args.kwonlyargs]
    if not any(p.arg in ACCEPTED for p in parameters):
        return None
    for p in parameters:
        if p.arg in ACCEPTED:
            own = ast.unparse(p.annotation) if p.annotation else ""
            none = " | None" if own.endswith("| None") and "None" not in ACCEPTED[p.arg] else ""
            p.annotation = ast.parse(ACCEPTED[p.arg] + none, mode="eval").body
    missing = ast.Constant(...)
    function.args.defaults = [missing for _ in function.args.defaults]
    function.args.kw_defaults = [d and missing for d in function.args.kw_defaults]
    doc = (ast.get_docstring(function) or "").partition("\n")[0]
    function.body = [ast.Expr(ast.Constant(doc))]
    function.decorator_list = [
        d for d in function.decorator_list if ast.unparse(d) == "contextmanager"
    ]
    names = {n.id for n in ast.walk(function) if isinstance(n, ast.Name)}
    used |= {n: m for n, m in _origins(body, module).items() if n in names}
    used |= {n: m for n, m in IMPORTED.items() if n in names}
    return ast.unparse(ast.fix_missing_locations(function))


def _origins(body: list[ast.stmt], module: str) -> dict[str, str]:
    """Return the module of each name that a source file imports or defines."""
    out = {}
    for node in ast.walk(ast.Module(body, [])):
        if isinstance(node, ast.ImportFrom) and node.module:
            origin = node.module.removeprefix("heli3dof")
            out |= {a.name: origin for a in node.names}
    for node in body:
        targets = node.targets if isinstance(node, ast.Assign) else []
        out |= {t.id: module for t in targets if isinstance(t, ast.Name)}
        if isinstance(node, ast.ClassDef):
            out[node.name] = module
    return out


def statements(text: str) -> list[str]:
    """Return a stub's statements, in an order that does not depend on the formatter."""
    return sorted(map(ast.unparse, ast.parse(text).body))


if __name__ == "__main__":
    STUB.write_text(stub(), "utf-8")
