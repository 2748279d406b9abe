"""Effects: found, named as the contract names them, absent at their null value."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from heli3dof.errors import UsageError
from heli3dof.model.effects import Effect, Parameter, all_names, effects, term, terms
from heli3dof.model.physics import state_layout as at
from heli3dof.model.physics.compiled_effects import address
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.model.physics.state_layout import context
from heli3dof.rig.profile import default_profile

CONTRACT = {
    "friction.coulomb": ("torque_Nm", {"roll", "pitch", "yaw"}),
    "friction.viscous": ("damping_Nms_per_rad", {"roll", "pitch", "yaw"}),
    "drag.quadratic": ("drag_Nms2_per_rad2", {"roll", "pitch", "yaw"}),
    "stiffness.pendulum": ("torque_Nm", {"roll", "pitch"}),
    "stiffness.cable": ("stiffness_Nm_per_rad", {"yaw"}),
    "bias.torque": ("torque_Nm", {"pitch", "yaw"}),
    "mass.imbalance": ("torque_Nm", set()),
    "inertia": ("ratio", {"roll", "pitch", "yaw"}),
    "motor.lag": ("time_constant_s", set()),
    "motor.delay": ("delay_s", set()),
    "motor.dead_zone": ("voltage_V", set()),
    "motor.thrust_curve": ("quadratic_share", set()),
    "motor.thrust_gain": ("gain", set()),
    "motor.thrust_mismatch": ("front_over_back", set()),
    "motor.saturation": ("limit_V", set()),
    "motor.supply_sag": ("sag_per_V", set()),
    "mass.change": ("mass_kg", set()),
    "encoder.backlash": ("angle_deg", {"roll", "pitch", "yaw"}),
    "timing.gaps": ("lost_share", set()),
    "timing.jitter": ("jitter_s", set()),
    "encoder.offset": ("angle_deg", {"roll", "pitch", "yaw"}),
    "encoder.scale": ("scale", {"roll", "pitch", "yaw"}),
    "disturbance.periodic": ("torque_Nm", {"roll", "pitch", "yaw"}),
    "geometry": ("share", set()),
}
RNG = np.random.default_rng(0)


@pytest.mark.parametrize("name", CONTRACT)
def test_the_contracts_effects_have_the_contracts_names_axes_and_units(name: str) -> None:
    parameter, axes = CONTRACT[name]
    effect = effects()[name]
    assert effect.parameters[0].name == parameter
    assert set(effect.axes) == axes


def test_a_mistyped_effect_is_answered_with_the_nearest() -> None:
    with pytest.raises(UsageError, match=r"friction\.coulomb\.yaw"):
        term("friction.colomb.yaw")
    with pytest.raises(UsageError, match="needs an axis"):
        term("friction.coulomb")
    with pytest.raises(UsageError, match="named twice"):
        terms(["motor.lag", "motor.lag"])


def test_the_other_words_for_the_axes_are_understood() -> None:
    assert term("friction.viscous.travel").name == "friction.viscous.yaw"


def acting(name: str, values: list[float], out: list[float], **state: float) -> list[float]:
    """Return ``out`` after the effect's equation, with these parameters, on the default rig."""
    t = term(name)
    s = context(default_profile())
    for key, value in state.items():
        s[getattr(at, key)] = value
    par = np.zeros(at.PARAMETERS)
    par[at.A : at.A + len(values)] = values
    array = np.array(out, dtype=float)
    (hook,) = t.effect.hooks.values()
    hook(s, par, np.zeros(at.MEMORY), array)
    return [float(x) for x in array]


@pytest.mark.parametrize(
    ("n", "torque"), [(1.0, 0.02 * 3), (2.0, 0.02 * 5), (0.5, 0.02 * 2.414214)]
)
def test_the_reaction_torque_is_a_power_of_each_rotor_s_thrust(n: float, torque: float) -> None:
    """One rotor at its hover thrust F_h, one at 2 F_h: κ F_h (1 + 2ⁿ)."""
    p = default_profile()
    hover = p.motor.K_f * p.motor.V_o
    level = {"F_FRONT": hover, "F_BACK": 2 * hover}
    assert acting("aero.reaction_torque", [0.02, n], [0, 0, 0], **level) == pytest.approx(
        [0, 0, torque * hover]
    )
    backward = {"F_FRONT": -hover, "F_BACK": 0.0}
    assert acting("aero.reaction_torque", [0.02, n], [0, 0, 0], **backward)[2] == pytest.approx(
        -0.02 * hover
    )


def test_the_lower_rotor_of_a_tilted_body_has_more_ground_effect() -> None:
    """L_a sin 27.5° = 0.304934 m above the table, tips L_h sin 30° = 0.0889 m above and below."""
    front, back = acting("aero.ground_effect", [0.2, 0.1], [1, 1], R=0.0, P=np.radians(30))
    assert front == pytest.approx(1 + 0.2 * np.exp(-(0.304934 + 0.0889) / 0.1), rel=1e-4)
    assert back == pytest.approx(1 + 0.2 * np.exp(-(0.304934 - 0.0889) / 0.1), rel=1e-4)


def test_a_drift_takes_a_share_of_both_thrusts_that_grows_with_time() -> None:
    assert acting("motor.thrust_drift", [0.001], [1.1, 0.8], T=50.0) == pytest.approx([1.045, 0.76])
    assert acting("motor.thrust_drift", [0.01], [1.1, 0.8], T=200.0) == [0.0, 0.0]  # none is left


@pytest.mark.parametrize("name", all_names())
def test_machine_code_does_what_the_python_says(name: str) -> None:
    t = term(name)
    s = context(default_profile())
    s[at.R : at.R + 6] = [0.2, -0.1, 0.7, 0.3, -0.4, 0.2]
    s[at.F_FRONT], s[at.F_BACK], s[at.T] = 1.1, 0.8, 12.0
    s[at.SPEED_FRONT], s[at.SPEED_BACK] = 9.0, 7.0
    par = np.zeros(at.PARAMETERS)
    par[at.AXIS] = t.axis_index
    for i, q in enumerate(t.effect.parameters):
        par[at.A + i] = q.null + 0.7 * q.typical
    proto = ctypes.CFUNCTYPE(None, *[ctypes.POINTER(ctypes.c_double)] * 4)
    for stage, hook in t.effect.hooks.items():
        mine = s.copy() if stage is at.Stage.SETUP else np.array([0.9, -0.6, 0.4])
        theirs, mem = mine.copy(), np.zeros(at.MEMORY)
        hook(s, par, mem, mine)
        pointers = [
            a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in (s, par, mem, theirs)
        ]
        proto(address(hook))(*pointers)
        np.testing.assert_allclose(theirs, mine, rtol=1e-14, atol=1e-16)


SWITCHES = [n for n in all_names() if not term(n).effect.parameters]


def test_only_the_choice_of_the_base_is_a_switch_without_parameters() -> None:
    assert SWITCHES == ["base.hover"]


@pytest.mark.parametrize("name", sorted(set(all_names()) - set(SWITCHES)))
def test_at_its_null_value_an_effect_changes_nothing(name: str) -> None:
    t = term(name)
    par = np.zeros(at.PARAMETERS)
    par[at.AXIS] = t.axis_index
    for i, q in enumerate(t.effect.parameters):
        par[at.A + i] = q.null
    s = context(default_profile())
    s[at.R : at.R + 6] = RNG.normal(0, 0.3, 6)
    for stage, hook in t.effect.hooks.items():
        out = s.copy() if stage is at.Stage.SETUP else np.array([0.9, 0.6, 0.4])
        before = out.copy()
        hook(s, par, np.zeros(at.MEMORY), out)
        np.testing.assert_allclose(out, before, rtol=1e-14)


def test_parameters_start_inside_their_bounds() -> None:
    structure = Structure(default_profile(), terms(all_names()))
    for f in structure.free:
        assert f.low <= f.start <= f.high, f.name
        assert f.unscaled(f.scaled(f.start)) == pytest.approx(f.start)


def test_a_plugin_that_cannot_be_loaded_is_left_out_with_a_warning(monkeypatch, caplog) -> None:  # type: ignore[no-untyped-def]
    import heli3dof.model.effects as package

    class Broken:
        value = "nowhere:EFFECT"

        def load(self) -> None:
            raise ImportError("no such module")

    monkeypatch.setattr(package, "entry_points", lambda group: [Broken()])
    package._all.cache_clear()
    try:
        assert "motor.lag" in package.effects()
        assert "nowhere:EFFECT" in caplog.text
    finally:
        package._all.cache_clear()


def test_a_mass_below_the_axis_is_thrown_out_where_the_arm_spins() -> None:
    """P = 0.1 kg·m² level, ψ̇ = 2 rad/s: 0.1·2² = 0.4 N·m on roll; rising at 1 rad/s, −2·0.1·1·2
    on yaw; none at 45°."""
    torque = effects()["inertia.product"].hooks[at.Stage.TORQUE]
    for roll, expected in ((0.0, [0.4, 0.0, -0.4]), (np.pi / 4, [0.0, 0.0, 0.0])):
        s, par, out = np.zeros(at.SIZE), np.zeros(at.PARAMETERS), np.zeros(3)
        s[at.R], s[at.R_DOT], s[at.PSI_DOT], par[at.A] = roll, 1.0, 2.0, 0.1
        torque(s, par, np.zeros(at.MEMORY), out)
        assert out == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("n", "lost"), [(1.0, 0.6), (0.5, 0.3 * np.sqrt(2)), (0.0, 0.3)])
def test_a_rotor_that_rises_at_twice_the_hover_thrust_loses_as_its_exponent_says(
    n: float, lost: float
) -> None:
    """k = 0.3 s/m at 1 m/s, F = 2 F_h: 0.3 · 2ⁿ F_h. Rising at ṙ = 1/L_a: both rotors at 1 m/s."""
    profile = default_profile()
    inflow = effects()["aero.inflow"].hooks[at.Stage.THRUST]
    s, par = context(profile), np.zeros(at.PARAMETERS)
    F_h = profile.motor.K_f * profile.motor.V_o
    s[at.R : at.R + 6] = 0.0
    s[at.R_DOT] = 1 / profile.geometry.L_a
    par[at.A], par[at.B] = 0.3, n
    out = np.array([2 * F_h, 2 * F_h, 0.0])
    inflow(s, par, np.zeros(at.MEMORY), out)
    assert out[:2] == pytest.approx((2 - lost) * F_h, rel=1e-12)


SIZE = Parameter("torque_Nm", "N·m", 0.0, -1.0, 1.0, 0.1, "its size")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"low": 1.0, "high": -1.0}, "low is 1, not below high, -1"),
        ({"null": 3.0}, "null is 3, outside the bounds"),
        ({"typical": 0.0}, "typical is 0, which is not positive"),
    ],
)
def test_a_mistake_in_a_parameter_is_stated(wrong: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(SIZE, **wrong)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"parameters": SIZE}, "a single one needs a comma"),
        ({"axes": ("travel",)}, "axes contains 'travel'; axes are roll, pitch, yaw"),
        ({"hooks": {"torque": print}}, "not Stage.TORQUE"),
        ({"hooks": {at.Stage.TORQUE: "print"}}, "contains 'print', not a function"),
        ({"parameters": (SIZE, SIZE)}, "two parameters have the name 'torque_Nm'"),
        (
            {"parameters": tuple(replace(SIZE, name=f"p{i}") for i in range(at.PARAMETERS))},
            "more than 9 parameters",
        ),
        ({"probes": ((0.1,), (0.1, 0.2))}, r"probes contains \(0.1, 0.2\), with 2 values"),
        ({"scan": "frequency"}, "needs a second parameter"),
        ({"starts": (5.0, 1.0)}, "starts does not ascend"),
        ({"evidence": "yaw_angle"}, "evidence is 'yaw_angle', which is none of roll, pitch"),
    ],
)
def test_a_mistake_in_an_effect_is_stated(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        replace(Effect("magnet", "A magnet.", (SIZE,), {}), **wrong)
