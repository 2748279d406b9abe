"""docs/plans.md holds every plan and every key of a segment, and each says what it is."""

from __future__ import annotations

import pytest

from heli3dof.experiment.plan import load_plan, named_plans
from heli3dof.experiment.plans_page import PAGE as MADE
from heli3dof.experiment.segments import kinds
from heli3dof.toml_file import key_of
from tests.paths import ROOT

PAGE = (ROOT / "docs" / "plans.md").read_text(encoding="utf-8")


def test_the_tables_are_the_plans() -> None:
    fix = "run: python -m heli3dof.experiment.plans_page docs/plans.md"
    assert MADE.renewed(PAGE) == PAGE, fix


@pytest.mark.parametrize("kind", sorted(kinds()))
def test_every_key_of_a_segment_says_what_it_is(kind: str) -> None:
    for name, field in kinds()[kind].model_fields.items():
        key = key_of(field)
        assert name == "kind" or (key is not None and key.meaning), name


@pytest.mark.parametrize("name", named_plans())
def test_every_plan_says_what_it_flies_and_what_it_is_good_for(name: str) -> None:
    plan = load_plan(name)
    assert plan.description
    assert plan.purpose
    assert "\n" not in plan.description + plan.purpose
