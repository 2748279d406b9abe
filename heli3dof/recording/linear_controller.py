"""A sampled linear controller, identified from a log (`model.control.controller_identification`).

    v[k] = clip(Σ_{j=1…n} A_j v[k−j] + Σ_{j=0…n} B_j y[k−j] + w[k], ±v_max)

v (2,) V are the motor voltages after the limiter, y (3,) rad the angles; A_j (2, 2) and B_j (2, 3)
are the gains of a controller of order n. The input w (2,) V is the rest: references, excitations,
constants, and what the law does not explain. Before the first row, v and y are zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class LinearController:
    """Gains of a linear control law of order n = len(A), and how well it explains the voltages.

    ``share`` is the upper quartile, over blocks of the log, of the ratio σ_e/std(Δu)
    (`model.control.unexplained_share`). σ_e is the standard deviation of the law's error e (V). u
    are the motor voltages without those that the experiment added, Δu = u[k] − u[k−1].
    """

    A: FloatArray
    """(n, 2, 2) A_1 … A_n, without unit"""
    B: FloatArray
    """(n + 1, 2, 3) V/rad, B_0 … B_n"""
    share: float = 0.0
    """Unexplained share of the voltages' changes (`model.control.controller_identification`)"""

    def input_of(self, v: FloatArray, y: FloatArray) -> FloatArray:
        """Return the input w (N, 2) V for which the law gives v (N, 2) V at angles y (N, 3) rad.

        >>> law = LinearController(np.ones((1, 2, 2)), np.ones((2, 2, 3)))
        >>> law.input_of(np.array([[1.0, 1], [4, 3]]), np.zeros((2, 3))).tolist()
        [[1.0, 1.0], [2.0, 1.0]]
        """
        n, N = len(self.A), len(v)
        v_before, y_before = (np.vstack([np.zeros((n, x.shape[1])), x]) for x in (v, y))
        w = v - sum(v_before[n - j : n - j + N] @ self.A[j - 1].T for j in range(1, n + 1))
        w -= sum(y_before[n - j : n - j + N] @ self.B[j].T for j in range(n + 1))
        return np.asarray(w)
