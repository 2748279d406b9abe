"""The table of docs/reference/profile.md has a text for every key."""

from __future__ import annotations

import pytest

from heli3dof.rig.profile import Profile
from heli3dof.toml_file import key_of, keys


@pytest.mark.parametrize("name", [name for name, _ in keys(Profile)])
def test_every_key_has_a_meaning_and_a_required_one_a_measurement(name: str) -> None:
    field = dict(keys(Profile))[name]
    key = key_of(field)
    assert key is not None
    assert key.meaning
    if field.is_required():
        assert key.measure
        assert key.typical
        assert key.plausible
