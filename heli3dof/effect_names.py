"""The rule for the names of effects, both of the models and of the emulated rig.

The name of an effect is followed by its axis where it acts on one: ``friction.coulomb.yaw`` is the
effect ``friction.coulomb`` on yaw.
"""

from __future__ import annotations

import re

from heli3dof.axes import ALIASES, AXES

NAME = re.compile(r"[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)*")


def name_mistake(name: str) -> str:
    """Return what is wrong with an effect's name, as a sentence; empty if the name is valid.

    >>> name_mistake("magnet.detent"), name_mistake("magnet.yaw")
    ('', "'magnet.yaw' ends in an axis, which heli3dof itself appends to an effect's name.")
    """
    if not NAME.fullmatch(name):
        return f"{name!r} does not consist of words of small letters, digits and _, with dots."
    if name.rpartition(".")[2] in {*AXES, *ALIASES}:
        return f"{name!r} ends in an axis, which heli3dof itself appends to an effect's name."
    return ""
