"""The emulated rig is the truth that models are tried against: it must share nothing with them."""

from __future__ import annotations

import pytest

from tests.paths import ROOT
from tests.test_dependencies import imports_of

ALLOWED = {"errors", "axes", "rig"}


@pytest.mark.parametrize(
    "path", sorted((ROOT / "drivers").rglob("*.py")), ids=lambda p: str(p.relative_to(ROOT))
)
def test_a_driver_imports_only_the_rig_package_the_errors_and_the_axes(path):
    ours = {n.split(".")[1] for n in imports_of(path) if n.startswith("heli3dof.")}
    assert ours <= ALLOWED
