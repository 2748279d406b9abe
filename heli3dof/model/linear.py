"""`LinearModel`: a discrete-time state-space model in innovation form, about a trim.

    x[k+1] = A x[k] + B (V[k] − u0) + K e[k]
      y[k] = C x[k] + y0 + e[k],      cov e = S

V (V) is held from k to k+1; y is (r, p, ψ) in rad. Hover and black-box models both are of this
form; the hover model has K = 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Shapes: A (n, n), B (n, 2), C (3, n), K (n, 3), S (3, 3), u0 (2,) V, y0 (3,) rad."""

    name: str
    kind: str
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    K: np.ndarray
    S: np.ndarray
    u0: np.ndarray
    y0: np.ndarray
    dt: float
    """s"""
    extra: Mapping[str, Any] = field(default_factory=dict)
    """Whatever else belongs in the model file: standard deviations, recordings, versions."""

    @property
    def order(self) -> int:
        return int(self.A.shape[0])
