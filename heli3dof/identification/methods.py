"""The methods there are: a name, a sentence, and the module whose ``fit`` does it.

Modules are imported when they are asked for.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass

from heli3dof.errors import UsageError, did_you_mean
from heli3dof.identification.fit_result import Found, Request
from heli3dof.identification.preprocessing import Prepared


@dataclass(frozen=True)
class Method:
    """``assumes_open_loop``: biased where the voltages answer the angles. ``physical``: has terms
    that can be switched on and off, and can use recordings that lack an angle."""

    sentence: str
    module: str
    assumes_open_loop: bool = False
    physical: bool = False


METHODS: dict[str, Method] = {
    "greybox": Method(
        "physical parameters by maximum likelihood (extended Kalman filter, encoder edges)",
        "heli3dof.identification.greybox.method",
        physical=True,
    ),
    "freeflight": Method(
        "physical parameters from free flights of up to 3 s, for logs that bear no likelihood",
        "heli3dof.identification.greybox.freeflight",
        physical=True,
    ),
    "pem": Method(
        "prediction error in innovation form, started from PBSID-opt",
        "heli3dof.identification.black_box.methods",
    ),
    "pbsid": Method(
        "PBSID-opt subspace identification", "heli3dof.identification.black_box.methods"
    ),
    "tf4": Method(
        "the paper's form: common fourth-order denominator, output error",
        "heli3dof.identification.black_box.tf4_method",
        assumes_open_loop=True,
    ),
    "oe": Method(
        "output error (K = 0) in state-space form",
        "heli3dof.identification.black_box.methods",
        assumes_open_loop=True,
    ),
}
OPEN_LOOP_WARNING = (
    "Output error takes the voltages as independent of the disturbances, but in closed loop they "
    "answer them, and yaw integrates, so simulated errors pile up: its parameters are biased and "
    "its standard deviations are far too small. It is here to reproduce the paper; use greybox or "
    "pem."
)


def known_method(name: str) -> Method:
    """The method of that name. Raises UsageError naming the nearest."""
    if name in METHODS:
        return METHODS[name]
    raise UsageError(
        f"There is no method {name!r}.",
        cause=f"a typing error; {did_you_mean(name, METHODS)}",
        fix="--method with one of " + ", ".join(METHODS),
    )


def fit(prepared: Prepared, request: Request) -> Found:
    """Fit by the method that the request names."""
    module = importlib.import_module(known_method(request.method).module)
    found: Found = module.fit(prepared, request)
    return found
