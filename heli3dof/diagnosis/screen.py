"""The screen: how much of every candidate there is in the innovations, without fitting any.

With the filter's gains held, a probe changes the predictions c of the events by δc, a trace over
the whole flight. The base's own parameters could imitate a part of it; with their tangents T, the
events' scores g and informations w, W = diag(w), H = T W Tᵀ + Λ

    u = δc·g − (T W δc)ᵀ H⁻¹ (T g − Λ(θ − θ_0))        efficient score
    v = δc W δc − (T W δc)ᵀ H⁻¹ (T W δc)               its information
    z = u / √v,     u/v: how many times the probe there is

z is N(0, 1) where the likelihood is exact. It is not (the filter is Gaussian, encoders in a
feedback loop are not), which is why `heli3dof.diagnosis.nulls` says what z is like where nothing
is hidden. The score is Rao's; the projection makes a refit of the base unnecessary.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.catalogue import Probe
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import Pass, score_and_information
from heli3dof.model.filtering import Data
from heli3dof.model.rig_model import Structure


@dataclass(frozen=True, eq=False)
class Screen:
    """P probes: z-scores and amplitudes, and the base's own score."""

    probes: tuple[Probe, ...]
    z: np.ndarray
    """(P,)"""
    amplitude: np.ndarray
    """(P,) of the first parameter, in its unit"""
    base_score: np.ndarray
    """(n,) of the base's coordinates, in standard deviations of its information"""


def screen(found: Estimate, probes: Sequence[Probe], data: Data | None = None) -> Screen:
    """All probes at the fitted base; on other ``data`` (a null's) at the same parameters."""
    problem, o = found.problem, found.optimum
    if data is None:
        at, T = o.at, o.tangents
    else:
        problem = replace(problem, data=data)
        at = problem.run(o.theta, o.noise)
        T = problem.tangents(o.theta, at)
    g, H = score_and_information(at, T)
    precision = problem.prior_precision
    g = g - precision * (o.theta - problem.prior_mean)
    A = H + np.diag(precision)
    D = traces(found, probes, problem.data, at)
    cross = (T * at.w) @ D.T
    solved = np.linalg.solve(A, cross)
    u = D @ at.g - solved.T @ g
    full = np.einsum("ij,j,ij->i", D, at.w, D)
    v = full - np.einsum("ij,ij->j", cross, solved)
    seen = v > 1e-6 * np.maximum(full, 1e-30)
    root = np.sqrt(np.where(seen, v, np.inf))
    size = np.array([p.size for p in probes])
    amplitude = np.where(seen, u / np.where(seen, v, 1.0), 0.0) * size
    return Screen(tuple(probes), u / root, amplitude, np.linalg.solve(A, g) * np.sqrt(np.diag(A)))


def traces(found: Estimate, probes: Sequence[Probe], data: Data, at: Pass) -> np.ndarray:
    """(P, E) δc of each probe: all of them in one pass, over a rig that holds every candidate."""
    from heli3dof.model.kalman import follow

    structure = found.structure
    held = {t.name for t in structure.terms}
    wanted = {p.term.name: p.term for p in probes if p.term.name not in held}
    wide = Structure(structure.profile, (*structure.terms, *wanted.values()))
    null = np.concatenate([found.values, [f.null for f in wide.free[len(found.values) :]]])
    where: dict[str, list[int]] = {}
    for i, f in enumerate(wide.free):
        if f.term is not None:
            where.setdefault(f.term, []).append(i)
    # An effect that is not there: a lag of zero, not its lowest bound.
    sets = [wide.arrays(null)]
    for p in probes:
        values = null.copy()
        values[where[p.term.name]] = p.values
        sets.append(wide.arrays(values))
    hooks = wide.hooks
    C = np.zeros((len(sets), len(at.row)))
    follow(
        np.array([s for s, _ in sets]), hooks.first, hooks.address,
        np.array([p for _, p in sets]), wide.memory, data.blocks, data.free,
        data.t, data.h, data.V, data.y, at.row, at.state, at.c, at.g, at.w, at.K, C,
    )  # fmt: skip
    return np.asarray(C[1:] - C[0])
