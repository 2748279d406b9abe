"""Base parameters outside the profile's tolerance: the rules, on synthetic values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis.estimate.base_parameters import BaseParameter, OffNominal
from heli3dof.diagnosis.free_run.base_off import (
    beyond_tolerance,
    fitted_base,
    halves_confirm,
    off_profile,
    one_factor,
)
from heli3dof.identification.greybox.freeflight import REAL_TERMS, problem_of
from heli3dof.identification.greybox.multistep import MultiStepFit
from heli3dof.model.effects import term
from tests.identification.known_flights import fly

TOLERANCE = 0.15


def parameter(ratio: float, std: float) -> BaseParameter:
    return BaseParameter("J_yaw", 1.0, ratio, std * ratio, "kg·m²", std)


@pytest.fixture(scope="module")
def known() -> MultiStepFit:
    """Return a fit at the prior means, with σ = 0.02 in each coordinate."""
    p = problem_of([fly(1022).recording.between(0, 25)], REAL_TERMS)
    D = np.eye(p.dim) / 0.02
    return MultiStepFit(p, p.start.copy(), np.ones(4), np.ones((7, 3)), 0.0, D, 0, True)


def scaled(fit: MultiStepFit, **ratios: float) -> MultiStepFit:
    """Return the fit with base parameters multiplied by these ratios."""
    z = fit.z.copy()
    for name, ratio in ratios.items():
        j = fit.structure.names.index(name)
        f = fit.structure.free[j]
        z[j] = f.inward(ratio * f.outward(z[j]))
    return replace(fit, z=z)


def test_an_interval_must_lie_outside_the_tolerance() -> None:
    """ln 1.45 − ln 1.15 = 0.232: 1.96 σ of 0.118."""
    assert beyond_tolerance(parameter(1.45, 0.117), TOLERANCE)
    assert not beyond_tolerance(parameter(1.45, 0.119), TOLERANCE)
    assert not beyond_tolerance(parameter(1.14, 0.001), TOLERANCE)


def test_both_halves_must_show_the_same_deviation() -> None:
    off, x = parameter(0.7, 0.05), float(np.log(0.7))
    assert halves_confirm([off, parameter(0.75, 0.05)], x, TOLERANCE)
    assert not halves_confirm([off, parameter(0.9, 0.02)], x, TOLERANCE)
    assert not halves_confirm([off, parameter(1.4, 0.05)], x, TOLERANCE)
    assert not halves_confirm([parameter(0.7, 0.01), parameter(0.75, 0.01)], x, TOLERANCE)


def test_three_inertias_off_by_one_factor_are_confounded_with_the_thrust_gain(
    known: MultiStepFit,
) -> None:
    fit = scaled(known, J_roll=0.7, J_pitch=0.7, J_yaw=0.7)
    off = off_profile(fit, (fit, fit), TOLERANCE)
    assert {o.term.name for o in off} == {"inertia.roll", "inertia.pitch", "inertia.yaw"}
    assert all(o.tied_with == ("motor.thrust_gain",) for o in off)
    assert [o.value for o in off] == pytest.approx([0.7] * 3)


def test_an_excess_trim_torque_is_a_mass_imbalance(known: MultiStepFit) -> None:
    fit = scaled(known, T_g=1.45)
    (off,) = off_profile(fit, (fit, fit), TOLERANCE)
    nominal = fit.structure.free[0].start
    assert off.term.name == "mass.imbalance"
    assert off.value == pytest.approx(0.45 * nominal)
    assert not off.tied_with


def test_a_weight_common_to_all_recordings_counts_with_the_trim_torque(known: MultiStepFit) -> None:
    j = known.structure.names.index("mass.imbalance.torque_Nm")
    p, z = known.problem, known.z.copy()
    z[p.n + list(p.own).index(j)] += known.structure.free[j].inward(0.1)
    more = fitted_base(replace(known, z=z))[0].value - fitted_base(known)[0].value
    assert more == pytest.approx(0.1)


def test_a_rig_within_its_profile_or_without_halves_has_no_finding(known: MultiStepFit) -> None:
    assert off_profile(known, (known, known), TOLERANCE) == ()
    fit = scaled(known, T_g=1.45)
    assert off_profile(fit, (), TOLERANCE) == ()
    assert off_profile(fit, (fit, known), TOLERANCE) == ()


def test_a_common_factor_holds_within_the_standard_deviations() -> None:
    def inertias(*ratios: float) -> list[OffNominal]:
        axes = ("roll", "pitch", "yaw")
        return [
            OffNominal(term(f"inertia.{a}"), v, 0.05 * v, 1.0)
            for a, v in zip(axes, ratios, strict=True)
        ]

    assert one_factor(inertias(0.70, 0.72, 0.69))
    assert not one_factor(inertias(0.7, 0.7, 1.3))
