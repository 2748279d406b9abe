"""Load the modules of a package, and plug-ins.

Plug-ins are objects that other installed packages register as Python entry points. A plug-in that
does not load causes a warning and is left out, so that it cannot stop heli3dof.
"""

from __future__ import annotations

import importlib
import logging
import pkgutil
from collections.abc import Callable, Iterator
from importlib.metadata import entry_points
from types import ModuleType
from typing import Any


def modules_of(package: str) -> Iterator[ModuleType]:
    """Import the modules of the package called ``package``; yield each one, sorted by name."""
    for found in pkgutil.iter_modules(importlib.import_module(package).__path__):
        yield importlib.import_module(f"{package}.{found.name}")


def use_plugins(group: str, kind: str, use: Callable[[Any], None]) -> None:
    """Load the object of each Python entry point in ``group`` and call ``use`` with it.

    If the import or ``use`` raises an exception, the function logs a warning and continues with the
    next entry point. The warning names the plug-in and its ``kind``, for example "driver".
    """
    for point in entry_points(group=group):
        try:
            use(point.load())
        except (Exception, SystemExit) as error:  # a plug-in may raise anything
            logging.getLogger("heli3dof").warning(
                "Warning: the %s %s (%s) does not load: %s. It is left out.",
                kind, point.name, point.value, error,
            )  # fmt: skip


def must_be(expected: type, plugin: object) -> None:
    """Raise TypeError unless ``plugin`` is an instance of ``expected``."""
    if not isinstance(plugin, expected):
        raise TypeError(f"it is a {type(plugin).__name__}; expected: {expected.__name__}")
