"""``pbsid``: PBSID-opt, a subspace method."""

from __future__ import annotations

from typing import TYPE_CHECKING

from heli3dof.identification.method import Method

if TYPE_CHECKING:
    from heli3dof.identification.fit_result import FitResult, Request
    from heli3dof.identification.preprocessing import Prepared


def fit(prepared: Prepared, request: Request) -> FitResult:
    """The fit of `heli3dof.identification.black_box.state_space`."""
    from heli3dof.identification.black_box import state_space

    return state_space.fit(prepared, request)


METHOD = Method("pbsid", "PBSID-opt subspace identification", fit)
