"""Compile functions with numba, cached on disk; recompile them if a function they call changes.

``numba.njit(cache=True)`` keeps machine code in ``__pycache__``, or in the user's cache folder if
``__pycache__`` is read-only. So only the first run after an installation compiles, for some
seconds. Numba checks only the file that contains the compiled function. After a change of a called
function in another file, numba would therefore run old code. `compiled` prevents this by adding a
digest of the called functions to numba's cache key.
"""

from __future__ import annotations

import hashlib
import inspect
import logging
import threading
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from typing import Any


@cache
def compiled(function: Callable[..., Any], *, leaf: bool = False, **options: Any) -> Any:
    """Return ``function`` compiled by ``numba.njit``, with the machine code cached on disk.

    A change in the function's file, in a compiled function that it calls, or in a global number
    that it uses causes recompilation.

    ``leaf``: the function creates no array and calls only leaf functions. It is then inlined into
    its callers and compiled without reference counting of arrays, which makes it faster.

    ``options`` go to numba; with ``error_model="numpy"`` a division by zero gives inf or NaN.
    Floating point is strict (no fastmath), so results are those of plain Python.
    """
    import numba

    if leaf:
        options |= {"_nrt": False, "forceinline": True}
    digest = _digest(function) + repr(sorted(options.items()))
    return numba.njit(cache=True, **options)(_with_cell(function, digest))


inlined = partial(compiled, leaf=True, error_model="numpy")
"""Decorator: compile a leaf function, as `compiled` does; a division by zero gives inf or NaN."""


@cache
def _digest(function: Callable[..., Any]) -> str:
    """Return a hash of the sources of ``function``.

    These are its file, the global numbers that it uses, and the compiled functions that it calls.
    """
    function = getattr(function, "py_func", function)
    h = hashlib.sha256(_source(inspect.getfile(function)))
    names: dict[str, Any] = getattr(function, "__globals__", {})
    for name in function.__code__.co_names:
        value = names.get(name)
        if isinstance(value, int | float):
            h.update(f"{name}={value!r}".encode())
        elif hasattr(value, "py_func"):
            h.update(_digest(value).encode())
    return h.hexdigest()


@cache
def _source(path: str) -> bytes:
    return Path(path).read_bytes()


def _with_cell(function: Callable[..., Any], content: str) -> Callable[..., Any]:
    """Return a copy of ``function`` whose cache key also contains the string ``content``."""
    code = function.__code__
    code = code.replace(co_freevars=(*code.co_freevars, "_digest"))
    cells = (*(function.__closure__ or ()), types.CellType(content))
    copy = types.FunctionType(
        code, function.__globals__, function.__name__, function.__defaults__, cells
    )
    copy.__module__, copy.__qualname__ = function.__module__, function.__qualname__
    copy.__doc__ = function.__doc__
    return copy


@contextmanager
def announced(sentence: str) -> Iterator[None]:
    """Context manager: log ``sentence`` as a warning if the ``with`` block takes over 1.5 s."""
    timer = threading.Timer(1.5, logging.getLogger("heli3dof").warning, (sentence,))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
