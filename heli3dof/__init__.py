"""heli3dof: fly, identify, compare and diagnose a 3-DOF helicopter.

Flying, recording, identifying, comparing, diagnosing and reporting can be done from Python::

    import heli3dof as h3

    flight = h3.fly_plan(h3.load_plan("multisine"), device="mock:?speed=max&seed=1")
    identified = h3.identify(flight.recording)
    comparison = h3.compare(
        [h3.load("step.mcap")], [h3.hover_model(h3.default_profile()), identified.model]
    )
    print(h3.diagnose(flight.recording).summary())

These subcommands are on the command line only: batch, demo, effect, exercise, fleet, monitor; also
``profile new``, ``profile update`` and ``diagnose --cluster``. In place of ``effect list``, call
the function `effects`.

In place of a plan, profile, recording or model, a function also accepts the path of its file. In
place of a built-in plan or model, it accepts the name. In place of a list with one element, it
accepts the element. Arrays are in SI units (s, V, rad). Their columns are roll, pitch, yaw for
angles and front, back for voltages.

Every error that a function of this package raises is a `Heli3dofError`. Its subclass `UsageError`
reports a wrong argument of a function, or a wrong value that was passed to a method. If an argument
of a method has the wrong type, the method may raise TypeError instead.

``__init__.pyi`` lists the public names, with the types that the functions accept. heli3dof imports
the module of a public name when the name is first used, so ``import heli3dof`` is quick.
"""

from __future__ import annotations

from functools import cache
from typing import Any


def __getattr__(name: str) -> Any:
    if name == "__all__":
        return sorted(_modules())
    if name == "__version__":
        from importlib.metadata import version

        return version("heli3dof")
    if name.startswith("_") or name not in _modules():
        raise AttributeError(f"module 'heli3dof' has no attribute {name!r}")
    from importlib import import_module
    from inspect import isfunction

    value = getattr(import_module(f"heli3dof.{_modules()[name]}"), name)
    if isfunction(value):
        from heli3dof.arguments import converted

        value = converted(value)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(_modules())


@cache
def _modules() -> dict[str, str]:
    """Return public name → module that defines it, as read from ``__init__.pyi``."""
    import ast
    from pathlib import Path

    stub = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [node for node in stub.body if isinstance(node, ast.ImportFrom) and node.level]
    return {a.name: str(node.module) for node in imports for a in node.names if a.asname}
