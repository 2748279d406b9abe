from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heli3dof.identification.black_box.one_step_predictor import (
    filter_states,
    free_responses,
    output_sensitivities,
)
from heli3dof.identification.black_box.pbsid import StateSpace
from heli3dof.identification.black_box.pem import _tangent, pem
from heli3dof.identification.black_box.uncertainty import in_continuous_time, poles, response_std
from tests.identification.systems import integrating_system, pbsid, record, sorted_poles

T = 0.05


@pytest.fixture(scope="module")
def fitted():  # type: ignore[no-untyped-def]
    data = [record(integrating_system(), 3000, 1)]
    return data, pem(data, pbsid(data, 5, 12))


def test_sensitivities_are_the_finite_differences() -> None:
    rng = np.random.default_rng(3)
    s = integrating_system()
    u, y = record(s, 60, 5)
    n, m, l = 5, 2, 3
    dW, dC = rng.standard_normal((n, n + m + l, 1)), rng.standard_normal((l, n, 1))

    def outputs(h: float) -> np.ndarray:
        W = np.hstack([s.At, s.B, s.K]) + h * dW[:, :, 0]
        C = s.C + h * dC[:, :, 0]
        parts = [np.ascontiguousarray(a) for a in np.split(W, [n, n + m], axis=1)]
        return filter_states(*parts, u, y, np.zeros(n)) @ C.T

    h = 1e-6
    expected = (outputs(h) - outputs(-h)) / (2 * h)
    x = filter_states(*(np.ascontiguousarray(a) for a in (s.At, s.B, s.K)), u, y, np.zeros(n))
    got = np.empty((60, l, 1))
    At, C = np.ascontiguousarray(s.At), np.ascontiguousarray(s.C)
    output_sensitivities(At, C, dW, dC, np.zeros((n, 1)), x, u, y, got)
    np.testing.assert_allclose(got[:, :, 0], expected, rtol=1e-6, atol=1e-9)


def test_free_responses_are_powers_of_the_state_matrix() -> None:
    A, C = np.array([[0.5, 0.1], [0.0, 0.2]]), np.array([[1.0, 1.0]])
    out = free_responses(A, C, 4)
    for k in range(4):
        np.testing.assert_allclose(out[k], C @ np.linalg.matrix_power(A, k))


@given(st.integers(0, 10_000))
@settings(max_examples=10, deadline=None)
def test_tangent_directions_change_no_state_coordinates(seed: int) -> None:
    rng = np.random.default_rng(seed)
    W, C = rng.standard_normal((4, 9)), rng.standard_normal((3, 4))
    T = _tangent(W, C, False, 2)
    assert T.shape == (4 * 9 + 12, 4 * (2 + 2 * 3))
    X = rng.standard_normal((4, 4))
    dW = X @ W
    dW[:, :4] -= W[:, :4] @ X
    gauge = np.concatenate([dW.ravel(), (-C @ X).ravel()])
    np.testing.assert_allclose(T.T @ gauge, 0, atol=1e-9)


def test_pem_improves_on_its_subspace_start(fitted) -> None:  # type: ignore[no-untyped-def]
    data, fit = fitted
    start = pbsid(data, 5, 12)
    assert fit.converged
    assert fit.cost < pem(data, start, max_iterations=0).cost
    system = integrating_system()
    np.testing.assert_allclose(sorted_poles(fit.model.A), sorted_poles(system.A), atol=0.015)


def test_the_predictor_is_stable_and_the_integrator_is_found(fitted) -> None:  # type: ignore[no-untyped-def]
    _, fit = fitted
    assert np.abs(np.linalg.eigvals(fit.model.At)).max() < 1
    assert min(abs(np.linalg.eigvals(fit.model.A) - 1)) < 0.005


def test_innovations_have_the_variance_of_the_simulation(fitted) -> None:  # type: ignore[no-untyped-def]
    _, fit = fitted
    np.testing.assert_allclose(np.diag(fit.model.S), [1e-6, 0.7e-6, 0.5e-6], rtol=0.1)


def test_the_fit_does_not_depend_on_the_start_s_coordinates(fitted) -> None:  # type: ignore[no-untyped-def]
    data, fit = fitted
    s = pbsid(data, 5, 12)
    Tr = np.random.default_rng(0).standard_normal((5, 5)) + 3 * np.eye(5)
    Ti = np.linalg.inv(Tr)
    turned = StateSpace(Tr @ s.A @ Ti, Tr @ s.B, s.C @ Ti, Tr @ s.K, s.d, s.S)
    again = pem(data, turned)
    assert again.cost == pytest.approx(fit.cost, abs=1e-4)
    np.testing.assert_allclose(sorted_poles(again.model.A), sorted_poles(fit.model.A), atol=2e-3)


def test_an_offset_changes_d_only(fitted) -> None:  # type: ignore[no-untyped-def]
    data, fit = fitted
    shifted = [(u, y + np.array([0.01, -0.02, 0.03])) for u, y in data]
    again = pem(shifted, pbsid(shifted, 5, 12))
    assert again.cost == pytest.approx(fit.cost, abs=1e-3)


def test_the_bound_on_the_predictor_s_time_constant_holds() -> None:
    data = [record(integrating_system(), 1500, 2)]
    fit = pem(data, pbsid(data, 5, 12), rho_max=0.8)
    assert np.abs(np.linalg.eigvals(fit.model.At)).max() <= 0.8


@pytest.mark.accuracy
def test_95_percent_intervals_of_poles_and_responses_cover_the_truth() -> None:
    """Nominal 95 %; 40 records, 5 poles and 6 responses each. Seeds 100 to 139."""
    system = integrating_system()
    truth = sorted(np.log(np.linalg.eigvals(system.A).astype(complex)) / T, key=_key)
    omega = np.array([2.0])
    G0 = in_continuous_time(system, T).response(omega)
    inside, total, hits, count = 0, 0, 0, 0
    for seed in range(100, 140):
        data = [record(system, 1200, seed)]
        fit = pem(data, pbsid(data, 5, 12))
        for got, want in zip(
            sorted(poles(fit, T), key=lambda p: _key(p.value)), truth, strict=True
        ):
            inside += abs(got.value.real - want.real) <= 1.96 * got.std_real
            total += 1
        std = response_std(fit, T, omega)
        # |G − Ĝ|² over its expectation has two degrees of freedom, so 3.0 is past 95 %
        ratio = np.abs(in_continuous_time(fit.model, T).response(omega) - G0) ** 2 / std**2
        hits += int((ratio < 3.84).sum())
        count += ratio.size
    assert 0.88 <= inside / total <= 0.99
    assert 0.88 <= hits / count <= 1.0


def _key(s: complex) -> tuple[float, float]:
    return (round(s.real, 1) if abs(s.imag) > 1 else s.real, s.imag)


def test_output_error_is_biased_under_feedback_and_pem_is_not() -> None:
    """Mean pole error over 10 records each, largest pole aside."""
    system = integrating_system(2e-2)
    truth = sorted_poles(system.A)
    errors = {True: [], False: []}
    for seed in range(10):
        data = [record(system, 1500, seed)]
        start = pbsid(data, 5, 12)
        for oe in (True, False):
            fit = pem(data, start, output_error=oe, rho_max=1 - 1e-6)
            errors[oe].append(np.abs(sorted_poles(fit.model.A) - truth).mean())
    assert np.median(errors[True]) > 2 * np.median(errors[False])
