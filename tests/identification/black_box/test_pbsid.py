from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.identification.black_box.pbsid import past, varx
from tests.identification.systems import integrating_system, pbsid, record, sorted_poles


def test_past_stacks_the_newest_row_first() -> None:
    u, y = np.arange(4.0)[:, None], 10 * np.arange(4.0)[:, None]
    np.testing.assert_array_equal(past(u, y, 2), [[1, 10, 0, 0], [2, 20, 1, 10]])


def test_a_first_order_varx_is_the_hand_computed_one() -> None:
    # y[k+1] = 0.5 y[k] + 2 u[k] + 3, exactly
    rng = np.random.default_rng(0)
    u = rng.standard_normal((50, 1))
    y = np.zeros((50, 1))
    for k in range(49):
        y[k + 1] = 0.5 * y[k] + 2 * u[k] + 3
    fit = varx([(u, y)], 1)
    np.testing.assert_allclose(fit.Xi, [[[2.0, 0.5]]], atol=1e-10)
    np.testing.assert_allclose(fit.d, [3.0], atol=1e-9)


def test_pbsid_recovers_the_original_poles_under_feedback() -> None:
    system = integrating_system()
    model = pbsid([record(system, 6000, 1)], 5, 15)
    np.testing.assert_allclose(sorted_poles(model.A), sorted_poles(system.A), atol=0.02)


def test_pbsid_takes_several_records_together() -> None:
    system = integrating_system()
    data = [record(system, 2000, s) for s in (1, 2, 3)]
    model = pbsid(data, 5, 15)
    np.testing.assert_allclose(sorted_poles(model.A), sorted_poles(system.A), atol=0.02)


def test_pbsid_is_exact_where_the_noise_is_small() -> None:
    system = integrating_system(1e-7)
    model = pbsid([record(system, 3000, 4)], 5, 25)
    np.testing.assert_allclose(sorted_poles(model.A), sorted_poles(system.A), atol=1e-5)
    # Markov parameters C B and C A B are the same in every basis
    np.testing.assert_allclose(model.C @ model.B, system.C @ system.B, atol=1e-4)
    np.testing.assert_allclose(
        model.C @ model.A @ model.B, system.C @ system.A @ system.B, atol=1e-4
    )


def test_an_offset_of_the_outputs_does_not_move_the_poles() -> None:
    system = integrating_system()
    u, y = record(system, 6000, 1)
    a = pbsid([(u, y)], 5, 15)
    b = pbsid([(u, y + np.array([0.3, -0.2, 0.1]))], 5, 15)
    np.testing.assert_allclose(sorted_poles(a.A), sorted_poles(b.A), atol=1e-6)


def test_too_few_rows_are_an_error_with_their_number() -> None:
    with pytest.raises(ValueError, match="30 rows"):
        varx([record(integrating_system(), 40, 0)], 10)


def test_the_state_space_form_gives_its_predictor() -> None:
    s = integrating_system()
    np.testing.assert_allclose(replace(s, K=0 * s.K).At, s.A)
    np.testing.assert_allclose(s.At, s.A - s.K @ s.C)
