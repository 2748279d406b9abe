"""``tf4``: the paper's transfer functions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from heli3dof.identification.method import Method

if TYPE_CHECKING:
    from heli3dof.identification.fit_result import FitResult, Request
    from heli3dof.identification.preprocessing import Prepared


def fit(prepared: Prepared, request: Request) -> FitResult:
    """The fit of `heli3dof.identification.black_box.tf4_method`."""
    from heli3dof.identification.black_box import tf4_method

    return tf4_method.fit(prepared, request)


METHOD = Method(
    "tf4",
    "the paper's form: common fourth-order denominator, output error",
    fit,
    assumes_open_loop=True,
)
