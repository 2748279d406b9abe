"""``freeflight``: physical parameters from multi-step predictions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from heli3dof.identification.method import Method

if TYPE_CHECKING:
    from heli3dof.identification.fit_result import FitResult, Request
    from heli3dof.identification.preprocessing import Prepared


def fit(prepared: Prepared, request: Request) -> FitResult:
    """The multi-step fit of `heli3dof.identification.greybox.freeflight`."""
    from heli3dof.identification.greybox import freeflight

    return freeflight.fit(prepared, request)


METHOD = Method(
    "freeflight",
    "physical parameters from free-run predictions of up to 3 s, for logs that rule out a "
    "likelihood",
    fit,
    physical=True,
)
