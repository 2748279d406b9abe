"""The syntax of hide=, and the catalogue against the specified effect names."""

from __future__ import annotations

import pytest
from heli3dof_drivers.emulator.effect_spec import parse_hide
from heli3dof_drivers.emulator.effects import catalogue

from heli3dof.axes import AXES
from heli3dof.errors import UsageError

# The specified effect names with their axes and parameters.
CONTRACT = {
    "friction.coulomb": (AXES, ["torque_Nm"]),
    "friction.viscous": (AXES, ["damping_Nms_per_rad"]),
    "drag.quadratic": (AXES, ["drag_Nms2_per_rad2"]),
    "stiffness.pendulum": (("roll", "pitch"), ["torque_Nm"]),
    "stiffness.cable": (("yaw",), ["stiffness_Nm_per_rad"]),
    "bias.torque": (("pitch", "yaw"), ["torque_Nm"]),
    "mass.imbalance": ((), ["torque_Nm"]),
    "inertia": (AXES, ["ratio"]),
    "motor.lag": ((), ["time_constant_s"]),
    "motor.delay": ((), ["delay_s"]),
    "motor.dead_zone": ((), ["voltage_V"]),
    "motor.thrust_curve": ((), ["quadratic_share"]),
    "motor.thrust_gain": ((), ["gain"]),
    "motor.thrust_mismatch": ((), ["front_over_back"]),
    "motor.saturation": ((), ["limit_V"]),
    "motor.supply_sag": ((), ["sag_per_V"]),
    "aero.ground_effect": ((), None),
    "aero.reaction_torque": ((), None),
    "aero.inflow": ((), None),
    "aero.gyroscopic": ((), None),
    "mass.change": ((), ["mass_kg", "time_s"]),
    "encoder.backlash": (AXES, ["angle_deg"]),
    "encoder.offset": (AXES, ["angle_deg"]),
    "encoder.scale": (AXES, ["scale"]),
    "disturbance.periodic": (AXES, ["torque_Nm", "frequency_Hz"]),
    "timing.gaps": ((), ["lost_share"]),
    "timing.jitter": ((), ["jitter_s"]),
}


@pytest.mark.parametrize("name", CONTRACT)
def test_every_effect_of_the_contract_is_there_with_its_axes_and_parameters(name):
    effect = catalogue()[name]
    axes, parameters = CONTRACT[name]
    assert effect.axes == tuple(axes)
    if parameters is not None:
        assert [p.name for p in effect.parameters] == parameters


@pytest.mark.parametrize("name", catalogue())
def test_every_example_parses_and_reads_back_as_itself(name):
    effect = catalogue()[name]
    (hidden,) = parse_hide([effect.example])
    assert hidden.effect is effect
    assert parse_hide([hidden.text]) == (hidden,)


@pytest.mark.parametrize("name", catalogue())
def test_every_effect_acts_on_the_setup_or_the_run(name):
    effect = catalogue()[name]
    assert effect.kernels or effect.setup
    assert effect.summary.endswith(".")


def test_commas_repetition_and_aliases_of_axes_all_work():
    hidden = parse_hide(["friction.coulomb.travel:0.03, mass.change:0.05@20", "motor.lag:1e-1"])
    assert {h.text for h in hidden} == {
        "friction.coulomb.yaw:0.03",
        "mass.change:0.05@20",
        "motor.lag:0.1",
    }


def test_effects_act_in_the_order_of_the_signals_path():
    names = ["motor.thrust_curve:0.5", "motor.dead_zone:1", "motor.delay:0.02"]
    assert [h.effect.name for h in parse_hide(names)] == [
        "motor.delay",
        "motor.dead_zone",
        "motor.thrust_curve",
    ]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("friction.columb.yaw:0.03", "friction.coulomb.yaw"),
        ("friction.coulomb:0.03", "an axis is missing"),
        ("friction.coulomb.yw:0.03", "'yaw'"),
        ("stiffness.cable.roll:0.1", "yaw"),
        ("motor.lag.roll:0.1", "has no axis"),
        ("motor.lag", "time_constant_s (s) is missing"),
        ("motor.lag:fast", "'fast' is not a number"),
        ("motor.lag:nan", "not a number"),
        ("motor.lag:100", "outside 0 … 1"),
        ("motor.lag:0.1@3", "2 values"),
        ("mass.change:0.05", "time_s (s) is missing"),
        ("motor.lag:0.1,motor.lag:0.2", "hidden twice"),
        ("geometry", "run large"),
        ("geometry:1", "run large"),
        ("sorcery", "known"),
        ("aero.flapping:0.1", "only the models have it (heli3dof effect list"),
    ],
)
def test_a_malformed_effect_is_refused_with_a_correction(text, says):
    with pytest.raises(UsageError) as caught:
        parse_hide([text])
    assert says in str(caught.value)
    assert caught.value.cause
    assert caught.value.fix


def test_an_empty_text_hides_nothing():
    assert parse_hide([]) == parse_hide([""]) == ()


@pytest.mark.parametrize("values", ["phase_rad:0.3", "0.02@0.5@0.3"])
def test_a_wrong_value_names_the_values_that_the_effect_has(values: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse_hide([f"disturbance.periodic.yaw:{values}"])
    assert "the values are torque_Nm@frequency_Hz" in caught.value.cause
    assert caught.value.fix == "hide=disturbance.periodic.yaw:0.02@0.5"
