"""The identification methods that ``--method NAME`` selects.

Another package adds a method by an entry point of the group ``heli3dof.methods``:
``my_method = "my_package.my_module:METHOD"``.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from heli3dof.errors import UsageError, did_you_mean
from heli3dof.plugins import must_be, use_plugins

if TYPE_CHECKING:
    from heli3dof.identification.fit_result import FitResult, Request
    from heli3dof.identification.preprocessing import Prepared

GROUP = "heli3dof.methods"


@dataclass(frozen=True)
class Method:
    """An identification method: name for ``--method``, sentence for the help, and function."""

    name: str
    sentence: str
    function: str
    """The function that fits a model, as text ``module:function``. It is called with a `Prepared`
    (`heli3dof.identification.preprocessing`) and a `Request`, and returns a `FitResult` (both
    `heli3dof.identification.fit_result`). The module is only imported for a fit, so that the
    command line can list all methods quickly."""
    assumes_open_loop: bool = False
    """True if feedback from the angles to the voltages biases the estimates."""
    physical: bool = False
    """True if the model consists of physical effects that the user can add or leave out. Such a
    method also gets the recordings that lack an angle (`Request.partial`)."""

    def fit(self, prepared: Prepared, request: Request) -> FitResult:
        """Return the fit to ``prepared`` with the options ``request``, by the method's function.

        Raises UsageError if the function cannot be imported or returns no `FitResult`.
        """
        from heli3dof.identification.fit_result import FitResult, Parameter

        module, _, name = self.function.partition(":")
        try:
            function = getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError) as error:
            raise UsageError(
                f"The method {self.name} cannot be imported from {self.function}: {error}.",
                cause="the text module:function in its METHOD is mistyped, or a library is not "
                "installed.",
                fix=f'python -c "import {module}"',
            ) from error
        result = function(prepared, request)
        if not isinstance(result, FitResult):
            raise UsageError(
                f"The method {self.name} returned a {type(result).__name__}; "
                "a method returns a FitResult.",
                cause=f"its function, {self.function}, is incomplete.",
                fix="read heli3dof/identification/fit_result.py, or use method='greybox'",
            )
        for parameter in result.parameters.values():
            must_be(Parameter, parameter)
        return result


BUILT_IN = (
    Method(
        "freeflight",
        "physical parameters from free-run predictions up to 3 s, if the likelihood is unsuitable",
        "heli3dof.identification.greybox.freeflight:fit",
        physical=True,
    ),
    Method(
        "greybox",
        "physical parameters by maximum likelihood (extended Kalman filter, encoder edges)",
        "heli3dof.identification.greybox.noise_check:fit",
        physical=True,
    ),
    Method(
        "oe",
        "output error (K = 0) in state-space form",
        "heli3dof.identification.black_box.state_space:fit",
        assumes_open_loop=True,
    ),
    Method(
        "pbsid",
        "PBSID-opt subspace identification",
        "heli3dof.identification.black_box.state_space:fit",
    ),
    Method(
        "pem",
        "prediction error in innovation form, started from PBSID-opt",
        "heli3dof.identification.black_box.state_space:fit",
    ),
    Method(
        "tf4",
        "the paper's form: common fourth-order denominator, output error",
        "heli3dof.identification.black_box.tf4_method:fit",
        assumes_open_loop=True,
    ),
)


@cache
def methods() -> Mapping[str, Method]:
    """Return all methods by name, including those of other packages.

    A plug-in that does not load is left out, and a warning is logged.
    """
    out = {m.name: m for m in BUILT_IN}

    def add(method: Method) -> None:
        must_be(Method, method)
        if method.name in out:
            raise ValueError(f"there is already a method {method.name!r}")
        out[method.name] = method

    use_plugins(GROUP, "method", add)
    return out


def known_method(name: str) -> Method:
    """Return the method ``name``.

    Raises UsageError for an unknown name; the error suggests a similar known one.
    """
    if name in methods():
        return methods()[name]
    raise UsageError(
        f"There is no method {name!r}.",
        cause=f"a typing error; {did_you_mean(name, methods())}",
        fix="one of " + ", ".join(methods()),
    )
