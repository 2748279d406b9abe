"""Load the modules of a package, and plug-ins.

Plug-ins are objects that other installed packages register as Python entry points. A plug-in that
does not load causes a warning and is left out, so that it cannot stop heli3dof.
"""

from __future__ import annotations

import importlib
import logging
import pkgutil
import re
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import entry_points
from types import ModuleType
from typing import Any

from heli3dof.errors import Heli3dofError

OWN = ("heli3dof", "heli3dof_drivers")
"""The packages of heli3dof: an unexpected exception there is a bug of heli3dof"""


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
                "Warning: the %s %s (%s) does not load: %s. It is left out. Correct %s",
                kind, point.name, point.value, in_a_line(error), where(error, point.value),
            )  # fmt: skip


@contextmanager
def plugin_errors(error: type[Heli3dofError], what: str, module: str) -> Iterator[None]:
    """Context manager: convert the unexpected exceptions of a plug-in's code to ``error``.

    ``what`` names the plug-in, for the message. ``module`` is the plug-in's module or
    entry point. If it belongs to heli3dof, no exception is converted.
    """
    package = re.split("[.:]", module)[0]
    try:
        yield
    except (Exception, SystemExit) as problem:
        if isinstance(problem, Heli3dofError) or package in OWN:
            raise
        line = last_line(problem, package)
        raise error(
            f"{what} failed: {type(problem).__name__}: {problem}",
            cause=f"a bug in its package, {package}{f' ({line})' if line else ''}",
            fix=f"correct {package}, or report the bug to its author",
        ) from problem


class CodeError(Exception):
    """Raised if a function of a plug-in is wrong or does not compile.

    ``where`` is the function's ``file:line``.
    """

    def __init__(self, what: str, where: str) -> None:
        super().__init__(what)
        self.where = where


def source_line(function: Callable[..., Any]) -> str:
    """Return ``file:line`` of a function."""
    code = getattr(function, "__code__", None)
    return f"{code.co_filename}:{code.co_firstlineno}" if code else repr(function)


def in_a_line(error: BaseException) -> str:
    """Return the kind of an error and the first 300 characters of its text, without line breaks."""
    kind = "" if isinstance(error, CodeError) else f"{type(error).__name__}: "
    return f"{kind}{' '.join(str(error).split())[:300].rstrip('.')}"


def where(error: BaseException, entry_point: str) -> str:
    """Return where the plug-in ``entry_point`` (``module:object``) caused ``error``: ``file:line``.

    That is the line of the plug-in's package that ran last. Without such a line, the result is the
    file of the module, or ``entry_point`` if the module was not imported.
    """
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}:{error.lineno}"
    if isinstance(error, CodeError):
        return error.where
    module = entry_point.partition(":")[0]
    line = last_line(error, module.partition(".")[0])
    return line or getattr(sys.modules.get(module), "__file__", None) or entry_point


def last_line(error: BaseException, package: str) -> str | None:
    """Return ``file:line`` of the package's line that ran last before ``error``; None without."""
    for frame, line in reversed(list(traceback.walk_tb(error.__traceback__))):
        if str(frame.f_globals.get("__name__")).partition(".")[0] == package:
            return f"{frame.f_code.co_filename}:{line}"
    return None


def must_be(expected: type, plugin: object) -> None:
    """Raise TypeError unless ``plugin`` is an instance of ``expected``."""
    if not isinstance(plugin, expected):
        raise TypeError(f"it is a {type(plugin).__name__}; expected: {expected.__name__}")
