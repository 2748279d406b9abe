"""The voltage at which a grey-box model hovers level, with linear and nonlinear thrust."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.identification.greybox.thrust_scale import Measured
from heli3dof.identification.profile_update import profile_keys, ratios
from heli3dof.model.greybox.linearisation import hover_voltage, level_hover
from heli3dof.model.greybox.model import GreyBoxModel, nominal
from heli3dof.rig.profile import default_profile

RIG = default_profile()
K_f, V_o = RIG.motor.K_f, RIG.motor.V_o


def with_T_g(factor: float, *terms: str, **values: float) -> GreyBoxModel:
    """Return a model with the trim torque ``factor`` times the profile's, and effects."""
    model = nominal(RIG, terms, T_g=factor * RIG.trim_torque, **values)
    covariance = np.zeros((len(model.values),) * 2)
    covariance[0, 0] = (0.01 * RIG.trim_torque) ** 2
    return replace(model, covariance=covariance)


def test_with_linear_thrust_the_hover_voltage_is_T_g_over_2_L_a_K_f() -> None:
    hover = level_hover(with_T_g(1.2))
    assert hover is not None
    assert hover.voltage_V == pytest.approx(1.2 * V_o)
    assert hover.std_V == pytest.approx(0.01 * V_o)
    assert hover.thrust_N_per_V == pytest.approx(K_f)


def test_a_dead_zone_adds_its_voltage_to_the_hover_voltage() -> None:
    hover = level_hover(with_T_g(1.2, "motor.dead_zone", **{"motor.dead_zone.voltage_V": 1.0}))
    assert hover is not None
    assert hover.voltage_V == pytest.approx(1.2 * V_o + 1.0)
    assert hover.thrust_N_per_V * hover.voltage_V == pytest.approx(K_f * 1.2 * V_o)


def test_with_a_quadratic_rotor_curve_the_voltage_grows_with_the_root_of_the_torque() -> None:
    """F = K_f V_o (V/V_o)² gives V_h = V_o √1.44 = 1.2 V_o, and dV_h/V_h = ½ dT_g/T_g."""
    model = with_T_g(1.44, "motor.rotor_curve", **{"motor.rotor_curve.exponent": 2.0})
    hover = level_hover(model)
    assert hover is not None
    assert hover.voltage_V == pytest.approx(1.2 * V_o)
    assert hover.std_V == pytest.approx(1.2 * V_o * 0.5 * 0.01 / 1.44, rel=1e-3)
    assert hover_voltage(model, 30.0) == pytest.approx(1.2 * V_o * np.cos(np.pi / 6) ** 0.5)


def test_the_updated_profile_hovers_at_the_model_s_voltage() -> None:
    """T_g = 2 L_a K_f V_o holds in the new profile, and the ratio V_o is the hover voltage."""
    model = with_T_g(1.44, "motor.rotor_curve", **{"motor.rotor_curve.exponent": 2.0})
    base = {n: Measured(1.0, 1.0, 0.0) for n in ("J_roll", "J_pitch", "J_yaw")}
    base["K_f"] = Measured(K_f, 0.9 * K_f, 0.01 * K_f)
    keys = profile_keys(base, RIG, level_hover(model))
    assert keys["motor.V_o"].value == pytest.approx(1.2 * V_o)
    torque = 2 * RIG.geometry.L_a * keys["motor.K_f"].value * keys["motor.V_o"].value
    assert torque == pytest.approx(0.9 * 1.44 * RIG.trim_torque)
    assert ratios(base, RIG, level_hover(model))["V_o"] == keys["motor.V_o"]


def test_a_model_that_no_voltage_holds_level_has_no_hover_voltage() -> None:
    limited = with_T_g(1.2, "motor.saturation", **{"motor.saturation.limit_V": 5.0})
    assert level_hover(limited) is None
    base = {n: Measured(1.0, 1.0, 0.0) for n in ("K_f", "J_roll", "J_pitch", "J_yaw")}
    assert set(profile_keys(base, RIG, None)) == {"inertia.roll", "inertia.pitch", "inertia.yaw"}
    assert "V_o" not in ratios(base, RIG, None)
