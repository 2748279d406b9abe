"""Residual torque: axis, variable and size are found; an unmodified rig has none."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from heli3dof.diagnosis.constants import TIE
from heli3dof.diagnosis.unmodelled import torque_formula
from heli3dof.diagnosis.unmodelled.residual_torque import Hats, hat_scores, hats, linearised_run
from heli3dof.diagnosis.unmodelled.torque_evidence import evidence, evidence_without_nulls
from heli3dof.diagnosis.unmodelled.torque_formula import (
    PRODUCTS,
    ordered_products,
    proposals,
    significant_formula,
)
from heli3dof.diagnosis.unmodelled.unmodelled_torque import (
    THRESHOLD_SCALES,
    TORQUE_FALSE_ALARMS,
    ResidualTorque,
    gumbel_stretch,
    ranked_with_time_bonus,
    significant_torques,
    split_off_slow_noise,
)
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.closed_loop_fit.base_fit import fit_base
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.model.effects import term
from heli3dof.model.effects.empirical import KNOTS
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.recording import Recording
from tests.flown import flown
from tests.profiles import profile


def flight(seed: int, hide: str = "") -> Recording:
    device = "mock:?speed=max" + (f"&hide={hide}" if hide else "")
    return flown("rich", 40.0, device=device, seed=seed, profile=profile(rate_hz=250.0))


def corrected(recording: Recording) -> CorrectedFit:
    return fit_base(Setup((recording,), 0, 8))


def found(fit: CorrectedFit, recording: Recording) -> tuple[ResidualTorque, ...]:
    return significant_torques(evidence(fit, [recording], flights=8, seed=0))


@pytest.fixture(scope="module")
def coupled() -> tuple[Recording, CorrectedFit]:
    """A yaw torque of −0.1 N·m·s/rad times the pitch rate, which is not in the catalogue."""
    recording = flight(1201, "other.yaw_torque_from_pitch_rate:0.1")
    return recording, corrected(recording)


@pytest.fixture(scope="module")
def coupling(coupled: tuple[Recording, CorrectedFit]) -> ResidualTorque:
    """The most significant residual torque of that flight."""
    recording, fit = coupled
    return found(fit, recording)[0]


@pytest.fixture(scope="module")
def unmodified() -> tuple[Recording, CorrectedFit]:
    recording = flight(1202)
    return recording, corrected(recording)


def test_a_yaw_torque_from_the_pitch_rate_is_found_with_its_size(
    coupled: tuple[Recording, CorrectedFit], coupling: ResidualTorque
) -> None:
    fit, first = coupled[1], coupling
    assert (first.axis, first.depends_on) == ("yaw", "pitch_rate")
    assert first.share > 0.5
    assert first.confidence > 0.99
    z, torque = np.array(first.table).T
    weight = 1 / np.array(first.std) ** 2
    slope = np.polyfit(z, torque, 1, w=np.sqrt(weight))[0]
    assert slope == pytest.approx(-0.1, rel=0.1)
    assert first.resembles is None
    best, *_ = proposals(fit, first)
    assert best.term == "empirical.pitch_rate.yaw"
    assert best.start[0] == pytest.approx(-0.1, rel=0.1)


def test_a_formula_shows_a_torque_where_nothing_can_be_simulated() -> None:
    """In a whole flight: the threshold of a shorter one is higher, for its blocks are fewer."""
    device = "mock:?speed=max&hide=other.yaw_torque_from_pitch_rate:0.1"
    recording = flown("rich", device=device, seed=1201, profile=profile(rate_hz=250.0))
    x = evidence_without_nulls(corrected(recording))
    assert significant_formula(x) == ("yaw", "pitch_rate")


def test_an_unmodified_rig_has_no_significant_formula(
    unmodified: tuple[Recording, CorrectedFit],
) -> None:
    assert significant_formula(evidence_without_nulls(unmodified[1])) is None


def test_without_a_formula_that_fits_as_well_the_curve_is_proposed(
    coupled: tuple[Recording, CorrectedFit],
    coupling: ResidualTorque,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fit, first = coupled[1], coupling
    monkeypatch.setattr(torque_formula, "PRODUCTS", ("sin(roll)", "voltage_sum"))
    (curve,) = proposals(fit, first)
    assert not curve.is_formula
    assert curve.term.startswith("empirical.spline(pitch_rate:")
    assert curve.start == tuple(torque for _, torque in first.table)


@pytest.mark.parametrize(("loss", "first"), [(TIE / 2, "sin(yaw)"), (2 * TIE, "sin(yaw)*cos(yaw)")])
def test_the_simplest_product_is_proposed_unless_its_full_fit_is_worse(
    loss: float, first: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three products have nearly the same S; 2 ln L of the simplest one is lower by ``loss``."""
    near = ("sin(yaw)*cos(yaw)", "sin(yaw)", "sin(yaw)*voltage_sum")

    def with_product(fit: object, axis: str, product: str, c: float) -> object:
        return None, SimpleNamespace(loglik=-loss / 2 if product == "sin(yaw)" else 0.0)

    monkeypatch.setattr(torque_formula, "with_product", with_product)
    S = np.zeros(len(PRODUCTS))
    S[[PRODUCTS.index(x) for x in near]] = 100.0, 99.0, 98.0
    fit = cast(CorrectedFit, SimpleNamespace(inflation=1.0))
    order = ordered_products(fit, "yaw", S, np.zeros(len(PRODUCTS)))
    assert PRODUCTS[order[0]] == first
    assert {PRODUCTS[k] for k in order} == set(near) - ({"sin(yaw)"} if loss > TIE else set())


def test_an_unmodified_rig_has_no_residual_torque(
    unmodified: tuple[Recording, CorrectedFit],
) -> None:
    recording, fit = unmodified
    assert found(fit, recording) == ()


def test_a_draught_is_slow_noise_and_no_effect() -> None:
    """On roll 0.014 N·m RMS: 4 · 0.035 N·m · √(0.01 s/1 s), the emulator's law (its `noise`)."""
    device = "mock:?speed=max&noise_s=1&noise=4"
    recording = flown("rich", 40.0, device=device, seed=1203)
    effects, slow_noise = split_off_slow_noise(found(corrected(recording), recording))
    assert effects == ()
    (roll,) = (torque for torque in slow_noise if torque.axis == "roll")
    assert roll.size_Nm == pytest.approx(0.014, rel=0.3)


def test_time_comes_first_if_another_variable_explains_hardly_more() -> None:
    """Of four groups, roll and time on one axis, yaw and time on the other."""
    groups = ((0, "roll"), (0, "time"), (2, "yaw"), (2, "time"))
    library = cast(Hats, SimpleNamespace(groups=groups))
    x = np.array([40.0, 40.0 - TIE / 2, 100.0, 100.0 - 2 * TIE])
    assert ranked_with_time_bonus([0, 1, 2, 3], library, x) == [2, 3, 1, 0]


def test_the_residual_torque_lies_on_the_hidden_line(
    coupled: tuple[Recording, CorrectedFit],
) -> None:
    path = linearised_run(coupled[1])
    rows = path.in_runs
    slope = np.polyfit(path.variable("pitch_rate")[rows], path.torque[rows, 2], 1)[0]
    assert slope == pytest.approx(-0.1, rel=0.1)


def test_one_backward_pass_gives_the_score_of_any_torque(
    coupled: tuple[Recording, CorrectedFit],
) -> None:
    """Compare with the filter's finite difference for a small viscous friction."""
    fit = coupled[1]
    path = linearised_run(fit)
    terms = (*fit.structure.terms, term("friction.viscous.yaw"))
    extended = replace(fit.problem, structure=Structure(fit.structure.profile, terms))
    theta = np.append(fit.optimum.theta, 0.0)
    typical = terms[-1].effect.parameters[0].typical
    followed = extended.tangents(theta, path.at, np.array([len(theta) - 1]))[0] / typical
    backward = (-path.X[:, 5] * path.gradients[0][:, 2])[path.in_runs].sum()
    assert backward == pytest.approx(followed @ path.at.g, rel=0.02)


def test_forward_and_backward_passes_give_the_same_scores(
    coupled: tuple[Recording, CorrectedFit],
) -> None:
    path = linearised_run(coupled[1])
    library = hats(path, np.arange(3))
    u = library.scores(path)
    assert hat_scores(library, path, np.zeros((0, len(path.at.row)))).u == pytest.approx(
        u, abs=1e-9 * np.abs(u).max()
    )


def test_hat_functions_add_up_to_one(coupled: tuple[Recording, CorrectedFit]) -> None:
    """The sum of a group's scores is therefore that of a constant torque, for every variable."""
    path = linearised_run(coupled[1])
    library = hats(path, np.arange(3))
    constant = path.gradients[0][path.in_runs].sum(axis=0)
    sums = library.scores(path).reshape(3, -1, KNOTS).sum(axis=2)
    assert sums == pytest.approx(np.tile(constant[:, None], (1, sums.shape[1])), rel=1e-6)


@pytest.mark.parametrize("n", [8, 24])
def test_a_gumbel_tail_fitted_to_few_nulls_has_the_stated_probability(n: int) -> None:
    """Fit Gumbel distributions to n values each: location x̄ − γσ, scale σ = √6 s/π, stretched.

    For the true distribution P(x > a) = 1 − exp(−exp(−a)).
    """
    x = np.random.default_rng(0).gumbel(size=(100_000, n))
    scale = np.sqrt(6) * x.std(axis=1, ddof=1) / np.pi
    location = x.mean(axis=1) - np.euler_gamma * scale

    def share(stretched: float) -> float:
        return float(-np.expm1(-np.exp(-(location + THRESHOLD_SCALES * stretched * scale))).mean())

    assert share(gumbel_stretch(n)) == pytest.approx(TORQUE_FALSE_ALARMS, rel=0.25)
    assert share(1.0) > 2.5 * TORQUE_FALSE_ALARMS
