"""What every driver owes the port, as cases that run over any device URL.

In a driver's own tests::

    from heli3dof.rig.conformance import CASES, conforms

    @pytest.mark.parametrize("case", CASES, ids=str)
    def test_my_driver(case):
        conforms(case, "lab://bench-7")

or without pytest: ``python -m heli3dof.rig.conformance lab://bench-7``. A case that does not
hold raises `NotConforming`; one that says nothing of this rig raises `unittest.SkipTest`, which
pytest counts as skipped. Cases that move motors run on emulated rigs only, unless asked for:
on a real one they put out the amplifier's limit for a period, and lift the body.
"""

from .bench import Bench, Case, Host, NotConforming, conforms
from .of_drivers import CASES as _OF_DRIVERS
from .of_rigs import CASES as _OF_RIGS
from .of_safety import CASES as _OF_SAFETY

CASES: tuple[Case, ...] = (*_OF_DRIVERS, *_OF_RIGS, *_OF_SAFETY)
"""Every case, in the order in which they are best read"""

__all__ = ["CASES", "Bench", "Case", "Host", "NotConforming", "conforms"]
