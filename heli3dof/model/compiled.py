"""Compiling with numba, cached on disk, and recompiled when *anything it calls* has changed.

``numba.njit(cache=True)`` keeps machine code in ``__pycache__`` (or the user's cache folder where
that is read-only), so only the first simulation after an installation compiles, for some seconds.
Numba looks only at the file of the function itself: edit a function that it calls, and the old
code goes on flying. `compiled` adds the sources of ``calls`` to what the cache is checked against.
"""

from __future__ import annotations

import hashlib
import inspect
import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def compiled(
    function: Callable[..., Any],
    *,
    calls: tuple[Callable[..., Any], ...] = (),
    leaf: bool = False,
    **options: Any,
) -> Any:
    """``function`` under ``numba.njit``, cached; ``calls`` are the functions it calls.

    A ``leaf`` is called once a row or more, makes no array and calls none but leaves: it is built
    into its callers, and without numba's counting of references to arrays, which costs up to ten
    times as much as the sums of a rigid body do.

    Floating point is strict (no fastmath): the same numbers as in Python. ``options`` go to numba,
    for instance ``error_model="numpy"`` where no division by zero is to raise.
    """
    import numba

    if leaf:
        options |= {"_nrt": False, "forceinline": True}
    dispatcher: Any = numba.njit(cache=True, **options)(function)
    if calls:
        try:
            index = dispatcher._cache._cache_file
            index._source_stamp = (index._source_stamp, _sources(calls))
        except AttributeError:  # a numba whose cache is made otherwise: do without the cache
            return numba.njit(**options)(function)
    return dispatcher


def _sources(functions: tuple[Callable[..., Any], ...]) -> str:
    h = hashlib.sha256()
    for f in functions:
        h.update(Path(inspect.getfile(getattr(f, "py_func", f))).read_bytes())
    return h.hexdigest()


@contextmanager
def announced(sentence: str, after_s: float = 1.5) -> Iterator[None]:
    """Says ``sentence`` (to the log, once) where what is done inside takes longer than that.

    For first compilations, which take seconds and then never again.
    """
    timer = threading.Timer(after_s, logging.getLogger("heli3dof").warning, (sentence,))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
