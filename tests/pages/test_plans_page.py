"""The tables of docs/reference/plans.md have a text for every plan and key."""

from __future__ import annotations

import pytest

from heli3dof.experiment.plan import load_plan, named_plans
from heli3dof.experiment.segments import kinds
from heli3dof.toml_file import key_of


@pytest.mark.parametrize("kind", sorted(kinds()))
def test_every_key_of_a_segment_has_a_meaning(kind: str) -> None:
    for name, field in kinds()[kind].model_fields.items():
        key = key_of(field)
        assert name == "kind" or (key is not None and key.meaning), name


@pytest.mark.parametrize("name", named_plans())
def test_every_plan_has_a_description_and_a_purpose(name: str) -> None:
    plan = load_plan(name)
    assert plan.description
    assert plan.purpose
    assert "\n" not in plan.description + plan.purpose
