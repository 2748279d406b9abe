"""Names of parameters carry their unit, and it can be read from them."""

from __future__ import annotations

import doctest

import pytest

from heli3dof.model import parameter_units
from heli3dof.model.effects import effects
from heli3dof.model.parameter_units import named_unit, split_unit

PARAMETERS = {(p.name, p.unit) for e in effects().values() for p in e.parameters}


def test_the_doctests_pass() -> None:
    assert doctest.testmod(parameter_units).failed == 0


@pytest.mark.parametrize(("name", "unit"), sorted(PARAMETERS))
def test_the_name_of_a_parameter_ends_with_its_unit(name: str, unit: str) -> None:
    assert split_unit(name)[1] == unit.replace("–", "")
    assert name.endswith(named_unit(unit))


def test_other_names_have_no_unit() -> None:
    assert split_unit("flux_Wb") == ("flux_Wb", "")
    assert split_unit("front_over_back") == ("front_over_back", "")
    assert split_unit("drag_Nms3_per_rad3") == ("drag", "N·m·s³/rad³")
    assert split_unit("drag_Nms5_per_rad12") == ("drag", "N·m·s⁵/rad¹²")
    assert split_unit("stage_A1") == ("stage_A1", "")
