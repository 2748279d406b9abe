"""The identification methods: each file of this folder defines one as ``METHOD``.

Another package adds a method by an entry point of the group ``heli3dof.methods``:
``my_method = "my_package.my_module:METHOD"``.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from heli3dof.errors import UsageError, did_you_mean
from heli3dof.identification.method import Method
from heli3dof.plugins import modules_of, must_be, use_plugins

GROUP = "heli3dof.methods"


@cache
def built_in() -> Mapping[str, Method]:
    """Return the identification methods of this folder by name."""
    return {m.METHOD.name: m.METHOD for m in modules_of(__name__)}


@cache
def methods() -> Mapping[str, Method]:
    """Return all methods by name, including those of other packages.

    Logs a warning for a plug-in that does not load, and leaves it out.
    """
    out = dict(built_in())

    def add(method: Method) -> None:
        must_be(Method, method)
        if method.name in out:
            raise ValueError(f"there is already a method {method.name!r}")
        out[method.name] = method

    use_plugins(GROUP, "method", add)
    return out


def known_method(name: str) -> Method:
    """Return the method ``name``; raise UsageError, which suggests a similar name, if unknown."""
    if name in methods():
        return methods()[name]
    raise UsageError(
        f"There is no method {name!r}.",
        cause=f"a typing error; {did_you_mean(name, methods())}",
        fix="--method with one of " + ", ".join(methods()),
    )
