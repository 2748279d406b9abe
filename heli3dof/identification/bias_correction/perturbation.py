"""Compute how a small change of the model changes the filter's predictions, to first order.

The extended Kalman filter (`heli3dof.model.estimation.ekf_quantised`) estimates the state
x = (q, q̇): angles in rad and rates in rad/s. It updates x at E *events*. At each event it reads an
encoder; c is its prediction of this reading. A change of the model adds δa (rad/s²) to the angular
accelerations q̈. Then x and c change by

    δx ← Φ δx + [h²/2; h] δa          from one row of the data to the next, h (s) later
    δc = σ δx_c,   δx ← δx − K w δc   at each event

- Φ: transition matrix over h of the linearised model
- x_c: the component of x that the event reads; σ = ∂c/∂x_c
- w = −∂² ln Z/∂c²: information of the reading, with its likelihood Z
- K (E, 6): covariance of x and c before each event. The change of the model does not change the
  Kalman gain K w, by assumption

The module's functions:

- `forcing` computes δa from a change of parameters or effects. δa is constant within each chunk, a
  time interval of `CHUNK_S`.
- `forward` computes δc (E,) from δa.
- `backward` is the adjoint of `forward`. For given weights v_e, it computes the derivative L_b (3,)
  of the sum Σ_e v_e δc_e with respect to δa_b, the change δa in chunk b. For every δa, this sum is
  Σ_b L_b · δa_b. So one pass serves all changes of the model.
- `misreading` is for a change of an encoder's model. It computes the change δm (rad) of a predicted
  reading if the true angle stays the same.

With δm, `forward` computes δc = σ δx_c + δm at each event of this encoder. At the start of each run
(rows without gaps), the filter computes the angle from the recorded reading. The recorded reading
does not change, so this angle changes by −δm/σ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.identification.bias_correction import perturbation_passes as passes
from heli3dof.model.estimation.ekf_quantised import FilterRun
from heli3dof.model.estimation.filter_data import Data
from heli3dof.model.physics import state_layout as _s
from heli3dof.model.physics.parametrisation import Structure

CHUNK_S = 0.01  # s, chosen
MOVES_THRUST = {_s.Stage.SETUP, _s.Stage.VOLTAGE}
"""Stages whose hooks can change the thrusts that the rotor model computes from the voltages"""


@dataclass(frozen=True, eq=False)
class Path:
    """The filter's states and the model's accelerations in C chunks of successive data rows."""

    data: Data
    at: FilterRun
    chunk: np.ndarray
    """(C, 3) int64: first row, row after the last, block of `Data`"""
    X: np.ndarray
    """(C, 6) rad, rad/s: states in the middles of the chunks"""
    A: np.ndarray
    """(C, 3, 6) ∂q̈/∂(q, q̇)"""
    slope: np.ndarray
    """(3,) σ, the derivative of each axis' reading with respect to its angle"""
    thrust: np.ndarray
    """(C, 2) N, mean thrusts of the rotors in each chunk"""
    a: np.ndarray
    """(C, 3) rad/s², the model's accelerations"""

    @property
    def t(self) -> np.ndarray:
        """Return the time (C,) s of the middle of each chunk of rows."""
        return np.asarray(self.data.t[(self.chunk[:, 0] + self.chunk[:, 1]) // 2])

    @property
    def source(self) -> np.ndarray:
        """Return the index (C,) of each chunk's recording."""
        of_block = np.array([run.source for run in self.data.runs], dtype=np.int64)
        return np.asarray(of_block[self.chunk[:, 2]])


def path(structure: Structure, values: np.ndarray, data: Data, at: FilterRun) -> Path:
    """Return states and accelerations of the filter run ``at``, in chunks of `CHUNK_S` seconds.

    ``at`` must contain the run's states (``keep`` = 2). ``values``: the model's parameters.
    """
    assert at.X is not None
    size = max(1, round(CHUNK_S / float(np.median(data.h))))
    rows = [np.empty((0, 3), dtype=np.int64)]
    for b, (_, start, stop) in enumerate(data.blocks):
        edges = np.append(np.arange(start, stop - 1, size), stop - 1)
        rows.append(np.column_stack([edges[:-1], edges[1:], np.full(len(edges) - 1, b)]))
    chunk = np.concatenate(rows)
    A = np.empty((len(chunk), 3, 6))
    X = np.ascontiguousarray(at.X[(chunk[:, 0] + chunk[:, 1]) // 2])
    slope = np.ones(3)
    passes.slopes(
        *structure.arguments(values), data.blocks, data.free, data.t, data.h, data.V, chunk, X, A,
        slope,
    )  # fmt: skip
    thrust, a = np.zeros((len(chunk), 2)), np.zeros((1, len(chunk), 3))
    passes.forcing(
        *structure.arguments(values[None]), data.blocks, data.free, data.t, data.h, data.V, chunk,
        X, np.ones(1, dtype=bool), thrust, thrust, a,
    )  # fmt: skip
    return Path(data, at, chunk, X, A, slope, thrust, a[0])


def forcing(
    p: Path, wide: Structure, sets: Sequence[np.ndarray], moves: Sequence[bool]
) -> np.ndarray:
    """Return δa (J, C, 3) rad/s²: the accelerations of J changed models minus those of the base.

    ``p`` contains a run of the Kalman filter with the base model, divided into C chunks (short time
    intervals). Both accelerations are computed from the filter's state in the middle of a chunk.
    ``sets`` are the parameter values of the J changed models. ``wide`` is their structure, which
    may have more effects than the base model. ``moves`` (J,): True for a model whose thrusts differ
    from those of the base model.
    """
    d = p.data
    out = np.zeros((len(sets), len(p.chunk), 3))
    passes.forcing(
        *wide.arguments(np.array(sets)), d.blocks, d.free, d.t, d.h, d.V, p.chunk, p.X,
        np.array(moves, dtype=bool), p.thrust, np.empty_like(p.thrust), out,
    )  # fmt: skip
    return np.asarray(out - p.a)


def misreading(
    p: Path, wide: Structure, sets: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return how other parameter values change the encoder readings (rad) at the same true angles.

    ``p`` contains a run of the Kalman filter with E measurement updates, each with one reading.
    ``sets`` are J + 1 sets of parameter values of the model structure ``wide``. The results are the
    changes from the first set to each of the J others:

    - (J, E): the changes of the readings at the measurement updates
    - (J, B, 3): the changes of the three readings in the first row of each of B blocks (runs of
      rows without gaps)
    """
    at, blocks = p.at, p.data.blocks
    assert at.X is not None
    m = np.zeros((len(sets), len(at.row)))
    m0 = np.zeros((len(sets), len(blocks), 3))
    passes.misreading(*wide.arguments(np.array(sets)), blocks, at.row, at.state, at.X, m, m0)
    return m[1:] - m[0], m0[1:] - m0[0]


def forward(
    p: Path, a: np.ndarray, m: np.ndarray | None = None, m0: np.ndarray | None = None
) -> np.ndarray:
    """Return δc (J, E), the change of each predicted reading by each of J changes of the model.

    ``p`` contains a run of the Kalman filter, which predicts E encoder readings. ``a`` (J, C, 3)
    are the changes of the accelerations (rad/s²) in C chunks (short time intervals).

    ``m`` and ``m0`` are the two results of `misreading`, for changes of an encoder's model. If no
    encoder's model changes, they are None.

    - ``m`` (J, E): changes of the E predicted readings if the true angles stay the same
    - ``m0`` (J, B, 3): the same for the three readings in the first row of each of B blocks (runs
      of rows without gaps)
    """
    D = np.zeros((len(a), len(p.at.row)))
    start = np.zeros((len(a), len(p.data.blocks), 3)) if m0 is None else m0
    passes.forward(
        p.A, p.chunk, p.data.h, p.data.blocks, p.at.row, p.at.state, p.at.w, p.at.K, p.slope,
        np.ascontiguousarray(a), D if m is None else m, start, D,
    )  # fmt: skip
    return D


def backward(p: Path, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the derivatives of M weighted sums Σ_e v_e δc_e with respect to changes of the model.

    ``p`` contains a run of the Kalman filter, which predicts E encoder readings. δc_e is the change
    of the predicted reading e. ``v`` (M, E) contains the M sets of weights v_e. The three results
    are the derivatives with respect to

    - the changes of the model's accelerations in C chunks (short time intervals), (M, C, 3)
    - the changes of the encoder readings at unchanged angles (`misreading`), (M, E)
    - the changes of the filter's first state in each of B blocks (runs of rows without gaps),
      (M, B, 6)
    """
    L = np.zeros((len(v), len(p.chunk), 3))
    mu = np.zeros(v.shape)
    z0 = np.zeros((len(v), len(p.data.blocks), 6))
    passes.backward(
        p.A, p.chunk, p.data.h, p.data.blocks, p.at.row, p.at.state, p.at.w, p.at.K, p.slope,
        np.ascontiguousarray(v), L, mu, z0,
    )  # fmt: skip
    return L, mu, z0


def project_out(
    D: np.ndarray, tangents: np.ndarray, A: np.ndarray, w: np.ndarray | float = 1.0
) -> np.ndarray:
    """Return D̃, in the shape of D: D without the part that the fitted parameters can explain.

        D̃ = D − Xᵀ A⁻¹ T,        D w D̃ᵀ = D w Dᵀ − Xᵀ A⁻¹ X,        X = T w Dᵀ

    D (K, E) or (E,) are the changes of E predictions (rad) per unit of each of K causes.
    T = ``tangents`` (p, E) are those per unit of each of p fitted parameters, w (E,) is the
    predictions' information (1/rad²), and A (p, p) = T w Tᵀ + Λ with the prior's information Λ.
    D w D̃ᵀ is the part of the information D w Dᵀ that remains. Do not use D̃ w D̃ᵀ for it: that is
    smaller, because A includes Λ.
    """
    return np.asarray(D - np.linalg.solve(A, (tangents * w) @ D.T).T @ tangents)
