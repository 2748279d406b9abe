"""Test cases for the requirements that every driver must meet; they run on any device URL.

In a driver's own tests::

    from heli3dof.rig.conformance import CASES, conforms

    @pytest.mark.parametrize("case", CASES, ids=str)
    def test_my_driver(case):
        conforms(case, "lab://bench-7")

or without pytest: ``python -m heli3dof.rig.conformance lab://bench-7``. A failed case raises
`NotConforming`. A case that does not apply to this rig raises `unittest.SkipTest`, which pytest
counts as skipped. Cases that move motors run on emulated rigs only, unless ``moves=True``. On a
real rig they apply the highest voltage for a control period and lift the body.
"""

from .bench import Bench, Case, Host, NotConforming, conforms
from .driver_cases import CASES as _DRIVER_CASES
from .rig_cases import CASES as _RIG_CASES
from .safety_cases import CASES as _SAFETY_CASES

CASES: tuple[Case, ...] = (*_DRIVER_CASES, *_RIG_CASES, *_SAFETY_CASES)
"""Every case, in the order in which the cases run"""

__all__ = ["CASES", "Bench", "Case", "Host", "NotConforming", "conforms"]
