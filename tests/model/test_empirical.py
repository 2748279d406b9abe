"""Empirical torques: products of measured quantities and piecewise linear functions of them."""

from __future__ import annotations

import math
import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heli3dof.errors import UsageError
from heli3dof.model.effects import Term, effects, term
from heli3dof.model.effects.empirical import KNOTS, empirical_effect
from heli3dof.model.greybox.model import nominal
from heli3dof.model.model_file import save_model
from heli3dof.model.physics import state_layout as at
from heli3dof.paper.models import load_model
from heli3dof.rig.profile import default_profile
from tests.model.test_effects import test_machine_code_does_what_the_python_says as same_in_machine

PRODUCTS = {
    "roll_rate": 0.4,
    "sin(yaw)": math.sin(0.3),
    "sin(yaw)*cos(yaw)": 0.5 * math.sin(0.6),
    "abs(pitch_rate)*pitch_rate": -0.25,
    "voltage_front*voltage_back": 56.0,
    "voltage_sum*voltage_difference": -15.0,
}
SPLINE = "empirical.spline(yaw_rate:-0.4:0.4).roll"


def torque_of(t: Term, *values: float, **state: float) -> list[float]:
    s, par, out = np.zeros(at.SIZE), np.zeros(at.PARAMETERS), np.zeros(3)
    s[at.PSI], s[at.R_DOT], s[at.P_DOT] = 0.3, 0.4, -0.5
    s[at.V_FRONT], s[at.V_BACK] = 7.0, 8.0
    for name, value in state.items():
        s[getattr(at, name)] = value
    par[at.AXIS] = t.axis_index
    par[at.A : at.A + len(values)] = values
    (hook,) = t.effect.hooks.values()
    hook(s, par, np.zeros(at.MEMORY), out)
    return out.tolist()


@pytest.mark.parametrize(("product", "value"), PRODUCTS.items())
def test_a_product_is_the_coefficient_times_its_quantities(product: str, value: float) -> None:
    expected = pytest.approx([0.0, 2.0 * value, 0.0])
    assert torque_of(term(f"empirical.{product}.pitch"), 2.0) == expected


@given(rate=st.floats(-1.0, 1.0), seed=st.integers(0, 9))
def test_a_spline_interpolates_between_its_knots_and_is_constant_beyond(
    rate: float, seed: int
) -> None:
    torques = np.random.default_rng(seed).normal(size=KNOTS)
    expected = np.interp(rate, np.linspace(-0.4, 0.4, KNOTS), torques)
    assert torque_of(term(SPLINE), *torques, PSI_DOT=rate)[0] == pytest.approx(expected)


@pytest.mark.parametrize("name", [SPLINE, *(f"empirical.{p}.yaw" for p in PRODUCTS)])
def test_the_machine_code_computes_the_same(name: str) -> None:
    same_in_machine(name)


@pytest.mark.parametrize(
    "name",
    ["empirical.colour", "empirical.roll*pitch*yaw", "empirical.spline(roll:1:0)",
     "empirical.spline(roll)", "friction.viscous", "empirical."],
)  # fmt: skip
def test_other_names_are_no_empirical_effects(name: str) -> None:
    assert empirical_effect(name) is None


def test_an_unknown_quantity_is_an_unknown_effect() -> None:
    with pytest.raises(UsageError, match=r"no effect 'empirical\.colour\.yaw'"):
        term("empirical.colour.yaw")


def test_empirical_effects_are_no_candidates() -> None:
    assert not any(name.startswith("empirical") for name in effects())


@pytest.mark.parametrize("name", [SPLINE, "empirical.sin(yaw).pitch"])
def test_a_term_can_be_pickled(name: str) -> None:
    assert pickle.loads(pickle.dumps(term(name))) == term(name)


def test_a_model_file_keeps_empirical_terms(tmp_path: Path) -> None:
    name = "empirical.voltage_front*voltage_back.pitch"
    model = nominal(default_profile(), (name, SPLINE), **{f"{name}.coefficient": 0.001})
    read = load_model(save_model(model, tmp_path / "m.json"), default_profile())
    assert read.terms == (name, SPLINE)  # type: ignore[attr-defined]
    assert np.array_equal(read.values, model.values)  # type: ignore[attr-defined]
