"""The draw of hidden effects: number, sizes and names by level."""

from __future__ import annotations

import numpy as np
import pytest
from heli3dof_drivers.emulator.effect_spec import parse_hide

from heli3dof.exercise import levels
from heli3dof.exercise.levels import draw, right_names
from heli3dof.model.effects import term
from tests.hidden import sizes

DRAWS = [
    draw(level, np.random.default_rng([level, k])) for level in levels.LEVELS for k in range(200)
]


def test_medium_and_large_are_the_sizes_that_the_survey_flew() -> None:
    for name, (medium, large, way) in levels._SIZES.items():
        known = sizes.EFFECTS[name]
        assert (medium, large, way) == (*known.sizes[1:], known.way)
    for name, (parameter, medium, large) in levels._OUTSIDE.items():
        known = sizes.OUTSIDE[name]
        assert (parameter, medium, large) == (known.parameter, *known.sizes[1:])


def test_the_emulated_rig_accepts_every_draw_and_has_the_same_parameters() -> None:
    for causes, _ in DRAWS:
        hidden = parse_hide(c.text for c in causes)
        assert len(hidden) == len(causes)
        for cause in causes:
            (one,) = parse_hide([cause.text])
            assert [p.name for p in one.effect.parameters] == list(cause.values)
            assert one.values == pytest.approx(tuple(cause.values.values()))


@pytest.mark.parametrize(
    ("level", "counts"), [(1, {1}), (2, {1}), (3, {2}), (4, {2}), (5, {0, 1, 2})]
)
def test_a_level_hides_this_many_effects(level: int, counts: set[int]) -> None:
    first = 200 * (level - 1)
    assert {len(causes) for causes, _ in DRAWS[first : first + 200]} == counts


def test_from_level_4_the_rig_differs_and_no_cause_is_a_number_of_the_profile() -> None:
    assert {spread for _, spread in DRAWS[:600]} == {0.0}
    assert {spread for _, spread in DRAWS[600:]} == {levels.SPREAD}
    names = {c.name.split(".")[0] for causes, _ in DRAWS[600:] for c in causes}
    assert not names & {"mass", "inertia"}
    assert "other" in names


def test_a_large_effect_is_larger_than_the_medium_one() -> None:
    smallest = (1 - levels.NEARER) * 0.15
    for causes, _ in DRAWS[:200]:
        for cause in causes:
            if cause.name == "stiffness.cable.yaw":
                assert smallest <= cause.values["stiffness_Nm_per_rad"] <= 0.15


def test_names_that_describe_the_same_motion_are_right() -> None:
    assert right_names("aero.reaction_torque") == {"aero.reaction_torque", "encoder.offset.pitch"}
    assert right_names("inertia.yaw") == {"inertia.yaw"}
    assert right_names("other.yaw_torque_from_pitch_rate") == {"unmodelled.yaw"}
    for name in levels._SIZES:
        assert all(term(n) for n in right_names(name))
