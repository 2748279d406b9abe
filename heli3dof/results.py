"""`Result`: the base class of recordings, identifications, comparisons and diagnoses.

A notebook can display a `Result` as text, HTML or a figure. `heli3dof.report` draws the figures. It
imports the result classes, so these classes may not import it. Instead, pyproject.toml registers
the function that draws a class's figure. The registration is an entry point in the group `FIGURES`;
its name is the name of the class. `registered` returns the function. The groups `SUMMARIES` and
`DOCUMENTS` contain functions of other packages in the same way.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from html import escape
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any

from heli3dof.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURES = "heli3dof.figures"
"""Group of the functions that draw a result's figure"""
SUMMARIES = "heli3dof.summaries"
"""Group of the functions that return a result's summary"""
DOCUMENTS = "heli3dof.documents"
"""Group of the functions that return a result's JSON document"""
REPR_LINES = 3
"""Number of lines of a summary that a repr shows; it counts the further ones."""


class Result:
    """Base class of results that can be displayed as text, HTML or figure.

    A subclass defines `summary`, ``to_dict()`` and ``to_dataframe()``. If it is a dataclass, it
    needs ``repr=False``, because a generated repr would print all arrays.
    """

    def summary(self) -> str:
        """Return a short text about the result; its first lines are the object's repr."""
        raise NotImplementedError

    def plot(self, **options: Any) -> Figure:
        """Return a matplotlib figure; ``options`` go to the drawing function of this class.

        Raises UsageError if no drawing function is registered.
        """
        figure: Figure = registered(FIGURES, type(self).__name__)(self, **options)
        return figure

    def __repr__(self) -> str:
        lines = self.summary().splitlines()
        further = len(lines) - REPR_LINES
        shown = "\n".join(lines[:REPR_LINES])
        return f"{shown} … ({further} more in summary())" if further > 0 else shown

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.summary())}</pre>"


def registered(group: str, name: str) -> Callable[..., Any]:
    """Return the function that is registered as the entry point ``name`` in the group ``group``.

    ``name``: the name of a result class, such as ``Recording``. Raises UsageError if there is no
    such entry point.
    """
    for point in entry_points(group=group, name=name):
        function: Callable[..., Any] = point.load()
        return function
    raise UsageError(
        f"No function of the group {group} is registered for a {name}.",
        cause="heli3dof was updated but not installed again.",
        fix="pip install -e . in the checkout, or pip install --force-reinstall heli3dof",
    )


def optional(library: str, *, extra: str = "") -> Any:
    """Import and return an optional library, which the pip extra ``extra`` installs.

    By default the extra has the library's name. Raises UsageError with the installation command if
    the library is missing.
    """
    extra = extra or library
    try:
        return importlib.import_module(library)
    except ModuleNotFoundError as error:
        if error.name != library:
            raise
        raise UsageError(
            f"{library} is not installed.",
            cause=f"few users need it, so pip installs it with the extra {extra!r} only.",
            fix=f"pip install 'heli3dof[{extra}]'",
        ) from None
