"""The table of docs/reference/effects.md has a text for every effect."""

from __future__ import annotations

import pytest

from heli3dof.experiment.plan import load_plan
from heli3dof.model.effects import effects, term
from heli3dof.model.effects.base import ABSCISSAE


@pytest.mark.parametrize("name", effects())
def test_an_effect_has_its_experiment_its_confusions_and_its_figure(name: str) -> None:
    effect = effects()[name]
    assert effect.identifiable
    load_plan(effect.separated_by)
    for axis in effect.axes or (None,):
        own = name if axis is None else f"{name}.{axis}"
        assert term(own).evidence in ABSCISSAE
    for other in effect.confused_with:
        assert other in effects() or term(other)
