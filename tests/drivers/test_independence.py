"""The drivers share no code with the models that are tested against the emulated rig."""

from __future__ import annotations

import pytest

from tests.paths import ROOT
from tests.test_dependencies import imports_of

ALLOWED = {"errors", "axes", "effect_names", "plugins", "rig"}


@pytest.mark.parametrize(
    "path", sorted((ROOT / "drivers").rglob("*.py")), ids=lambda p: str(p.relative_to(ROOT))
)
def test_a_driver_imports_only_these_parts_of_heli3dof(path):
    ours = {n.split(".")[1] for n in imports_of(path) if n.startswith("heli3dof.")}
    assert ours <= ALLOWED
