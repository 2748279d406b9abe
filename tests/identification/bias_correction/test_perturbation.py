"""The projection that removes a fit's parameters, by hand for one parameter."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.identification.bias_correction.perturbation import project_out


def test_one_parameter_is_projected_out_as_by_hand() -> None:
    """T w Tᵀ = 4 and the prior's 1 give A = 5; X = 1, so D̃ = D − T/5 and D w D̃ᵀ = 1 − 1/5."""
    T, w, D = np.ones((1, 2)), np.array([1.0, 3.0]), np.array([1.0, 0.0])
    projected = project_out(D, T, np.array([[5.0]]), w)
    assert projected == pytest.approx([0.8, -0.2])
    assert (D * w) @ projected == pytest.approx(0.8)


def test_what_the_parameters_can_produce_is_projected_out() -> None:
    """The second prediction is the parameter's: its change vanishes, the rest stays."""
    T = np.array([[0.0, 2.0, 0.0]])
    assert project_out(np.array([1.0, 5.0, 3.0]), T, T @ T.T) == pytest.approx([1.0, 0.0, 3.0])
