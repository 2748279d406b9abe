"""Write a template of an effect: a package with an example equation, which the user replaces.

The equation is written twice, for the model and for the emulated rig. A flight of the emulated rig
with this effect then tests the model's equation independently.
"""

from __future__ import annotations

from heli3dof.effect_files.from_diagnosis import module_name, pyproject
from heli3dof.effect_names import name_mistake
from heli3dof.errors import UsageError
from heli3dof.model.effects import effects


def template_files(name: str) -> dict[str, str]:
    """Return {file name: text} of a package with an effect called ``name``.

    Raises UsageError if no effect can have this name, or another effect has it.
    """
    if mistake := name_mistake(name):
        raise UsageError(
            f"{name!r} is no name of an effect.",
            cause=mistake,
            fix="heli3dof effect new magnet.detent",
        )
    if name in effects():
        raise UsageError(
            f"There is an effect {name!r} already.",
            cause="heli3dof or an installed package has it.",
            fix="another name; heli3dof effect list shows those that are taken",
        )
    module = module_name(name)
    words = {"name": name, "module": module}
    return {
        "pyproject.toml": pyproject(module, is_emulated=True),
        f"{module}.py": _MODULE.format(**words),
        f"{module}_emulated.py": _EMULATED.format(**words),
        f"test_{module}.py": _TEST.format(**words),
    }


_MODULE = '''\
"""{name}: τ = −c q̇³ in N·m, with the rate q̇ (rad/s) of the axis. Replace it by your equation."""

from typing import Any

from heli3dof.model.effects import Effect, Parameter, Stage
from heli3dof.model.physics.state_layout import AXIS, R_DOT, A


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    axis = int(par[AXIS])
    out[axis] -= par[A] * s[R_DOT + axis] ** 3


EFFECT = Effect(
    name="{name}",
    summary="A torque −c q̇³.",
    # name, unit, value without the effect, lower and upper bound, typical size, symbol
    parameters=(Parameter("drag_Nms3_per_rad3", "N·m·s³/rad³", 0.0, -5.0, 5.0, 0.1, "c"),),
    hooks={{Stage.TORQUE: torque}},
    axes=("roll", "pitch", "yaw"),
    evidence="{{axis}}_rate",
)
'''

_EMULATED = '''\
"""{name} of the emulated rig: τ = −c q̇³. Write your equation again, without the model's code."""

from heli3dof_drivers.emulator.effects.base import ALL_AXES, Effect, Parameter
from heli3dof_drivers.emulator.plant_effects import Row, kernel
from heli3dof_drivers.emulator.plant_layout import AXIS, R_DOT, A, Stage


@kernel
def torque(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    axis = int(par[AXIS])
    out[axis] -= par[A] * s[R_DOT + axis] ** 3


EFFECTS = (
    Effect(
        name="{name}",
        summary="A torque −c q̇³.",
        # name, unit, lowest and highest value that hide= accepts, symbol
        parameters=(Parameter("drag_Nms3_per_rad3", "N·m·s³/rad³", 0.0, 5.0, "c"),),
        example="{name}.yaw:0.5",
        axes=ALL_AXES,
        kernels={{Stage.TORQUE: torque}},
    ),
)
'''

_TEST = """\
# Replace the equation and the number, which you compute by hand.
import numpy as np
import pytest
from heli3dof.model.physics.state_layout import AXIS, MEMORY, PARAMETERS, PSI_DOT, SIZE, A

from {module} import torque


def test_the_torque_is_that_of_the_equation() -> None:
    s, par, out = np.zeros(SIZE), np.zeros(PARAMETERS), np.zeros(3)
    par[AXIS], par[A], s[PSI_DOT] = 2, 0.5, 2.0
    torque(s, par, np.zeros(MEMORY), out)
    assert out[2] == pytest.approx(-0.5 * 2.0**3)
"""
