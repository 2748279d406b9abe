"""Arrays of a structure for compiled functions."""

from __future__ import annotations

import pickle

import numpy as np

from heli3dof.model.effects import term
from heli3dof.model.physics.compiled_effects import address
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.rig.profile import default_profile


def test_addresses_of_functions_are_not_pickled() -> None:
    """In another process the functions are elsewhere; old addresses would end it."""
    names = ("friction.viscous.yaw", "motor.lag", "empirical.sin(yaw).pitch")
    structure = Structure(default_profile(), tuple(map(term, names)))
    there = structure.hooks.address
    assert len(there) > 1
    assert "address" in vars(structure.hooks)
    copy = pickle.loads(pickle.dumps(structure))
    assert "hooks" not in vars(copy)
    functions = structure.hooks.functions
    assert copy.hooks.address.tolist() == [*map(address, functions), 0] == there.tolist()
    assert np.array_equal(copy.hooks.first, structure.hooks.first)
