"""The predictor's answer to a small change, linearised along the path that the filter took.

With the filter's gains held, a change that adds δa (rad/s²) to the accelerations moves the state by

    δx ← Φ δx + [h²/2; h] δa,     Φ from ∂q̈/∂(q, q̇)          from row to row
    δc = σ δx_c,   δx ← δx − K w δc                             at each of the encoders' events

(`heli3dof.model.estimation.ekf_quantised`). `forward` gives the trace δc (E,) of a change;
`eliminate` the adjoint: for any weights q of the events, how Σ q δc depends on δa at every instant,

    Σ_e q_e δc_e = Σ_b L_b · δa_b

so that one backward pass serves every change there is. δa is taken as constant over chunks of
`CHUNK_S` (index b); `forcing` computes it for any change of the rig's numbers or effects.
A change δm of what an encoder reads at a given angle adds to δc at the angle's events, and starts
the state at −δm (`misreading`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.diagnosis.sensitivity import perturbation_passes as passes
from heli3dof.identification.greybox.likelihood import Pass
from heli3dof.model.estimation.filter_data import Data
from heli3dof.model.physics import state_layout as _s
from heli3dof.model.physics.parametrisation import Structure

CHUNK_S = 0.01
MOVES_THRUST = {_s.Stage.SETUP, _s.Stage.VOLTAGE}
"""Stages whose effects change the thrusts that `model.physics.rotor` computes beforehand."""


@dataclass(frozen=True, eq=False)
class Path:
    """Where the filter went: C chunks of rows, their states and the slopes of the accelerations."""

    structure: Structure
    data: Data
    at: Pass
    chunk: np.ndarray
    """(C, 3) int64: first row, last + 1, run"""
    X: np.ndarray
    """(C, 6) states in the chunks' middle"""
    A: np.ndarray
    """(C, 3, 6) ∂q̈/∂(q, q̇)"""
    slope: np.ndarray
    """(3,) of the readings, σ"""
    values: np.ndarray
    thrust: np.ndarray
    """(C, 2) N, the rotors' mean over each chunk"""
    a: np.ndarray
    """(C, 3) rad/s²"""

    @property
    def t(self) -> np.ndarray:
        """(C,) s, of the middles"""
        return np.asarray(self.data.t[(self.chunk[:, 0] + self.chunk[:, 1]) // 2])


def path(structure: Structure, values: np.ndarray, data: Data, at: Pass) -> Path:
    """``at`` must hold its states (``keep`` 2)."""
    assert at.X is not None
    size = max(1, round(CHUNK_S / float(np.median(data.h))))
    rows = [np.empty((0, 3), dtype=np.int64)]
    for b, (_, start, stop) in enumerate(data.blocks):
        edges = np.append(np.arange(start, stop - 1, size), stop - 1)
        rows.append(np.column_stack([edges[:-1], edges[1:], np.full(len(edges) - 1, b)]))
    chunk = np.concatenate(rows)
    hooks = structure.hooks
    s, par = structure.arrays(values)
    A = np.empty((len(chunk), 3, 6))
    X = np.ascontiguousarray(at.X[(chunk[:, 0] + chunk[:, 1]) // 2])
    slope = np.ones(3)
    passes.slopes(
        s, hooks.first, hooks.address, par, structure.memory, data.blocks, data.free, data.t,
        data.h, data.V, chunk, X, A, slope,
    )  # fmt: skip
    thrust, a = np.zeros((len(chunk), 2)), np.zeros((1, len(chunk), 3))
    passes.forcing(
        s[None], hooks.first, hooks.address, par[None], structure.memory, data.blocks, data.free,
        data.t, data.h, data.V, chunk, X, np.ones(1, dtype=bool), thrust, thrust, a,
    )  # fmt: skip
    return Path(structure, data, at, chunk, X, A, slope, values, thrust, a[0])


def forcing(
    p: Path, wide: Structure, sets: Sequence[np.ndarray], moves: Sequence[bool]
) -> np.ndarray:
    """(J, C, 3) rad/s²: what sets of values of the structure ``wide`` add to the path's own.

    ``moves`` (J,) says which of the sets change the rotors' thrusts.
    """
    d, hooks = p.data, wide.hooks
    arrays = [wide.arrays(v) for v in sets]
    out = np.zeros((len(sets), len(p.chunk), 3))
    passes.forcing(
        np.array([s for s, _ in arrays]), hooks.first, hooks.address,
        np.array([q for _, q in arrays]), wide.memory, d.blocks, d.free, d.t, d.h, d.V,
        p.chunk, p.X, np.array(moves, dtype=bool), p.thrust,
        np.empty_like(p.thrust), out,
    )  # fmt: skip
    return np.asarray(out - p.a)


def misreading(
    p: Path, wide: Structure, sets: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """What sets of values add to the readings of the first: m (J, E) rad at the events of angles,
    0 at others; and at the runs' starts (J, B, 3)."""
    d, hooks = p.data, wide.hooks
    arrays = [wide.arrays(v) for v in sets]
    at = p.at
    assert at.X is not None
    m = np.zeros((len(sets), len(at.row)))
    m0 = np.zeros((len(sets), len(d.blocks), 3))
    passes.misreading(
        np.array([s for s, _ in arrays]), hooks.first, hooks.address,
        np.array([q for _, q in arrays]), wide.memory, d.blocks, at.row, at.state, at.X, m, m0,
    )  # fmt: skip
    return m[1:] - m[0], m0[1:] - m0[0]


def forward(
    p: Path, a: np.ndarray, m: np.ndarray | None = None, m0: np.ndarray | None = None
) -> np.ndarray:
    """(J, E) the traces of the changes a (J, C, 3), and of misreadings m (J, E), m0 (J, B, 3)."""
    D = np.zeros((len(a), len(p.at.row)))
    start = np.zeros((len(a), len(p.data.blocks), 3)) if m0 is None else m0
    passes.forward(
        p.A, p.chunk, p.data.h, p.data.blocks, p.at.row, p.at.state, p.at.w, p.at.K, p.slope,
        np.ascontiguousarray(a), D if m is None else m, start, D,
    )  # fmt: skip
    return D


def backward(p: Path, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For weights q (M, E): L (M, C, 3), the events' own weights (M, E), and the starts' (M, B, 6).

    The events' weights say what a change of the *reading* at each does, the states moving after it.
    """
    L = np.zeros((len(q), len(p.chunk), 3))
    mu = np.zeros(q.shape)
    z0 = np.zeros((len(q), len(p.data.blocks), 6))
    passes.backward(
        p.A, p.chunk, p.data.h, p.data.blocks, p.at.row, p.at.state, p.at.w, p.at.K, p.slope,
        np.ascontiguousarray(q), L, mu, z0,
    )  # fmt: skip
    return L, mu, z0
