"""`Result`: the base class of recordings, identifications, comparisons and diagnoses.

The class displays such a result as text, HTML or figure in a notebook. `heli3dof.report` draws the
figures: `Result.plot` finds a class's drawing function by the class name among the entry points of
the group `FIGURES`.
"""

from __future__ import annotations

import importlib
from html import escape
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any

from heli3dof.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURES = "heli3dof.figures"
REPR_LINES = 3


class Result:
    """Base class of results that can be displayed as text, HTML or figure.

    A subclass defines `summary`, ``to_dict()`` and ``to_dataframe()``. If it is a dataclass, it
    needs ``repr=False``, because a generated repr would print all arrays.
    """

    def summary(self) -> str:
        """Return a short text about the result; its first three lines are the object's repr."""
        raise NotImplementedError

    def plot(self, **options: Any) -> Figure:
        """Return a matplotlib figure; ``options`` go to the drawing function of this class.

        Raises UsageError if no drawing function is registered.
        """
        name = type(self).__name__
        for point in entry_points(group=FIGURES, name=name):
            figure: Figure = point.load()(self, **options)
            return figure
        raise UsageError(
            f"No figure of a {name} is registered.",
            cause="heli3dof was updated but not installed again.",
            fix="pip install -e . in the checkout, or pip install --force-reinstall heli3dof",
        )

    def __repr__(self) -> str:
        return "\n".join(self.summary().splitlines()[:REPR_LINES])

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.summary())}</pre>"


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
