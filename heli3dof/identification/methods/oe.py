"""``oe``: output error in state-space form."""

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


METHOD = Method("oe", "output error (K = 0) in state-space form", fit, assumes_open_loop=True)
