"""``greybox``: physical parameters by maximum likelihood."""

from __future__ import annotations

from typing import TYPE_CHECKING

from heli3dof.identification.method import Method

if TYPE_CHECKING:
    from heli3dof.identification.fit_result import FitResult, Request
    from heli3dof.identification.preprocessing import Prepared


def fit(prepared: Prepared, request: Request) -> FitResult:
    """The likelihood's fit, or that of ``freeflight`` where the recordings rule out a likelihood.

    Only the default terms are replaced: a request that names its terms gets the likelihood.
    """
    from heli3dof.identification.greybox import freeflight, method
    from heli3dof.identification.greybox.noise_check import no_likelihood

    if request.terms is None and not request.partial and (reason := no_likelihood(prepared)):
        return freeflight.handed_over(freeflight.fit(prepared, request), reason)
    return method.fit(prepared, request)


METHOD = Method(
    "greybox",
    "physical parameters by maximum likelihood (extended Kalman filter, encoder edges)",
    fit,
    physical=True,
)
