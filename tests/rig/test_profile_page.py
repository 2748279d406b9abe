"""docs/profile.md holds every key, and every key says what it is."""

from __future__ import annotations

import pytest

from heli3dof.rig.profile import Profile
from heli3dof.rig.profile_page import PAGE as MADE
from heli3dof.toml_file import key_of, keys
from tests.paths import ROOT

PAGE = (ROOT / "docs" / "profile.md").read_text(encoding="utf-8")


def test_the_table_is_the_profiles() -> None:
    fix = "run: python -m heli3dof.rig.profile_page docs/profile.md"
    assert MADE.renewed(PAGE) == PAGE, fix


@pytest.mark.parametrize("name", [name for name, _ in keys(Profile)])
def test_a_key_says_what_it_is_and_a_required_one_how_to_measure_it(name: str) -> None:
    field = dict(keys(Profile))[name]
    key = key_of(field)
    assert key is not None
    assert key.meaning
    if field.is_required():
        assert key.measure
        assert key.typical
        assert key.plausible
