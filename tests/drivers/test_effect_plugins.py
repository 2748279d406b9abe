"""An effect of another package can be hidden in the emulated rig; a faulty one is left out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from heli3dof_drivers.emulator.body import setup_of
from heli3dof_drivers.emulator.effect_check import check_effect
from heli3dof_drivers.emulator.effect_spec import parse_hide
from heli3dof_drivers.emulator.effects import GROUP, Effect, Parameter, catalogue
from heli3dof_drivers.emulator.effects.friction import quadratic
from heli3dof_drivers.emulator.plant import Plant
from heli3dof_drivers.emulator.plant_effects import Row, kernel
from heli3dof_drivers.emulator.plant_layout import AXIS, R_DOT, A, Stage

from heli3dof import plugins
from heli3dof.effect_names import name_mistake
from heli3dof.errors import UsageError
from heli3dof.rig.profile import default_profile

PROFILE = default_profile()
J_yaw = 0.950809
SIZE = Parameter("drag_Nms3_per_rad3", "N·m·s³/rad³", 0.0, 10.0, "d")


@kernel
def cubic(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    axis = int(par[AXIS])
    out[axis] -= par[A] * s[R_DOT + axis] ** 3


@kernel
def broken(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    out[0] += par[A].no_such_thing


@kernel
def outside(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    out[3] += par[A]


@kernel
def infinite(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    out[2] += par[A] / s[R_DOT]


@kernel
def changes_the_state(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    s[R_DOT] = 0.0


def effect(name: str, function: Any) -> Effect:
    return Effect(name, "", (SIZE,), f"{name}.yaw:1", ("yaw",), {Stage.TORQUE: function})


def setup_only(function: Any) -> Effect:
    return replace(effect("drag.cubic", cubic), kernels={}, setup=function)


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Registers a plug-in for one test."""

    def install(plug_in: object) -> None:
        point = SimpleNamespace(name="mine", value="mine:EFFECTS", load=lambda: plug_in)
        points = {GROUP: [point]}
        monkeypatch.setattr(plugins, "entry_points", lambda group: points.get(group, []))
        catalogue.cache_clear()

    yield install
    catalogue.cache_clear()


@pytest.mark.parametrize("name", catalogue())
def test_every_effect_of_heli3dof_is_in_order(name: str) -> None:
    check_effect(catalogue()[name])
    assert name_mistake(name) == ""


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"parameters": SIZE}, "a single one needs a comma"),
        ({"parameters": (SIZE,) * 6}, "more than 5 parameters"),
        ({"axes": ("travel",)}, "axes contains 'travel'; axes are roll, pitch, yaw"),
        ({"kernels": {"TORQUE": cubic}}, "not Stage.TORQUE"),
        ({"kernels": {}}, "neither a kernel nor a setup"),
    ],
)
def test_a_mistake_in_an_effect_is_stated(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        replace(effect("drag.cubic", cubic), **wrong)


def test_the_rig_hides_an_effect_of_another_package(installed: Any) -> None:
    installed((effect("drag.cubic", cubic),))
    hidden = parse_hide(["drag.cubic.yaw:2"])
    setup = setup_of(PROFILE, "level")
    grid = PROFILE.encoder.rad_per_count
    p = Plant(setup, grid, dt=1e-5, hidden=hidden, noise=0.0, start_V=PROFILE.motor.V_o)
    p._state[5] = 0.5
    before = float(p.truth.rate[2])
    p.step(PROFILE.motor.V_o, PROFILE.motor.V_o)
    braking = (float(p.truth.rate[2]) - before) / 1e-5
    assert braking == pytest.approx(-2 * 0.5**3 / J_yaw, rel=1e-3)


@pytest.mark.parametrize(
    ("plug_in", "why"),
    [
        ((effect("drag.cubic", broken),), "no_such_thing"),
        ((effect("drag.quadratic", cubic),), "there is an emulated effect 'drag.quadratic'"),
        ((effect("drag.cubic", lambda *_: None),), "expected: Kernel"),
        (("drag.cubic",), "expected: Effect"),
        ((effect("drag.quadratic.yaw", cubic),), "ends in an axis"),
        ((effect("drag.cubic", outside),), "index 3 is out of bounds"),
        ((effect("drag.cubic", infinite),), "drag.cubic, TORQUE: ValueError: the result is not"),
        ((effect("drag.cubic", changes_the_state),), "read-only"),
        ((setup_only(lambda setup, axis, values: None),), "expected: Setup"),
        ((setup_only(lambda setup, axis, values: 1 / 0),), "ZeroDivisionError"),
    ],
)
def test_a_faulty_plug_in_is_left_out_with_a_warning(
    installed: Any, caplog: pytest.LogCaptureFixture, plug_in: object, why: str
) -> None:
    installed(plug_in)
    assert catalogue()["drag.quadratic"].kernels == {Stage.TORQUE: quadratic}
    (warning,) = caplog.messages
    assert "the emulated effect mine (mine:EFFECTS) does not load" in warning
    assert why in warning
    code = why.startswith(("index", "drag.cubic,", "read-only", "expected: Setup", "Zero"))
    assert not code or f"Correct {__file__}:" in warning
    with pytest.raises(UsageError, match="does not simulate an effect"):
        parse_hide(["drag.cubic.yaw:2"])
