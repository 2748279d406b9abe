"""The screen: how much of every candidate there is in the innovations, without fitting any.

With the filter's gains held, a probe changes the predictions c of the events by δc, a trace over
the whole flight. The base's own parameters could imitate a part of it; with their tangents T, the
events' scores g and informations w, W = diag(w), A = T W Tᵀ + Λ

    u = δc·g − (T W δc)ᵀ A⁻¹ (T g − Λ(θ − θ_0))        efficient score
    v = δc W δc − (T W δc)ᵀ A⁻¹ (T W δc)               its information
    z = u / √v,     u/v: how many times the probe there is

(Rao's score test; the projection makes a refit of the base unnecessary.) Every sum over events is
one over instants by the adjoint, Σ q δc = Σ L·δa (`sensitivity.perturbation`), which makes a
probe of a simulated null cost half a millisecond; and a torque of any frequency, or one that sets
in at any instant, is found by one Fourier transform, one running sum:

    z_scan² = max_f |u(f)|² / v(f),        max_{t_0} u(t_0)² / v(t_0)

v is that of the recording, for its nulls too, so that z of both are in one measure. z would be
N(0, 1) were the likelihood exact. It is not, which is why `screening.nulls` says what z is
like where nothing is hidden.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.estimate.evaluation import Evaluation
from heli3dof.diagnosis.screening.catalogue import Probe
from heli3dof.diagnosis.screening.scans import Scan
from heli3dof.diagnosis.sensitivity.perturbation import (
    MOVES_THRUST,
    backward,
    forcing,
    forward,
    misreading,
)
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import Likelihood, Pass
from heli3dof.model.effects import Term, term
from heli3dof.model.estimation.filter_data import Data
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.model.physics.state_layout import Stage


@dataclass(frozen=True, eq=False)
class ScreenResult:
    """One recording or null under the screen: P probes."""

    probes: tuple[Probe, ...]
    """Of a scan, the probe at its peak"""
    z: np.ndarray
    amplitude: np.ndarray
    """(P,) of the first parameter away from its null, in its unit"""


class Screen:
    """All probes at one estimate: ``here`` is the look at the recordings, which sets the scale."""

    def __init__(
        self, problem: Likelihood, theta: np.ndarray, here: Evaluation, probes: Sequence[Probe],
        scans: Sequence[Scan] = (),
    ) -> None:  # fmt: skip
        self.problem, self.theta = problem, theta
        self.scans = tuple(scans)
        self.plain = tuple(probes)
        self.values = problem.values(theta)
        self.sets = self._sets()
        self._built = here, self._changes(here)
        a, m, m0 = self._built[1]
        self.D = forward(here.path, a, m, m0)
        """(P, E) traces, of the plain probes"""
        self.weight = here.at.w
        self.full = np.einsum("ij,j,ij->i", self.D, here.at.w, self.D)
        self.cross = cross = (here.T * here.at.w) @ self.D.T
        self.A = A = here.H + np.diag(problem.prior_precision)
        self.solved = np.linalg.solve(A, cross)
        v = self.full - np.einsum("ij,ij->j", cross, self.solved)
        seen = v > 1e-6 * np.maximum(self.full, 1e-30)
        self.v = np.where(seen, v, np.inf)
        self.scales = [s.scale(here, self._unit(here, s.term), A) for s in self.scans]

    @property
    def names(self) -> tuple[str, ...]:
        """(P,) the terms of the probes, scans last"""
        return (*(p.name for p in self.plain), *(s.term.name for s in self.scans))

    def information(self) -> np.ndarray:
        """(P,) v per unit of the first parameter squared: what a 1-σ size is, before κ."""
        size = np.array([p.size if p.grows else np.inf for p in self.plain])
        return np.asarray(np.where(np.isfinite(self.v), self.v, 0.0) / size**2)

    def correlation(self, a: int, b: int) -> float:
        """Of two plain probes' traces, what the base could imitate of each taken out."""
        full = float((self.D[a] * self.weight) @ self.D[b])
        shared = full - float(self.cross[:, a] @ self.solved[:, b])
        return shared / float(np.sqrt(self.v[a] * self.v[b]))

    def shared(self, i: int, causes: np.ndarray) -> float:
        """What the ``causes`` ((n,) bool) take of the information that the base leaves of plain
        probe i: ρ² of it and them. Zero for a scan, and for what the base leaves nothing of."""
        if i >= len(self.plain) or not causes.any() or not np.isfinite(self.v[i]):
            return 0.0
        base, c = ~causes, self.cross[~causes, i]
        alone = self.full[i] - c @ np.linalg.solve(self.A[np.ix_(base, base)], c)
        return float(1 - self.v[i] / alone)

    def see(self, look: Evaluation, *, prior: bool) -> ScreenResult:
        """The screen of a look; ``prior``: of the recordings, whose score has the prior in it."""
        problem = self.problem
        g = look.g
        if prior:
            g = g - problem.prior_precision * (self.theta - problem.prior_mean)
        A = look.H + np.diag(problem.prior_precision)
        pull = np.linalg.solve(A, g)
        # q·δc with q = g − w Tᵀ A⁻¹ g is the efficient score of every δc at once.
        q = look.at.g - look.at.w * (pull @ look.T)
        L, mu, z0 = backward(look.path, q[None])
        built, changes = self._built
        a, m, m0 = changes if look is built else self._changes(look)
        u = np.einsum("pci,ci->p", a, L[0])
        u += m @ mu[0] - np.einsum("pbi,bi->p", m0, z0[0][:, :3] / look.path.slope)
        root = np.sqrt(self.v)
        size = np.array([p.size for p in self.plain])
        z, amplitude = [*(u / root)], [*(u / self.v * size)]
        found = list(self.plain)
        for scan, scale in zip(self.scans, self.scales, strict=True):
            peak, values, amount = scan.peak(look, L[0], self._unit(look, scan.term), scale)
            z.append(peak)
            amplitude.append(amount)
            found.append(Probe(scan.term, values, amount))
        return ScreenResult(tuple(found), np.array(z), np.array(amplitude))

    def _sets(self) -> list[tuple[list[int], Structure, list[np.ndarray]]]:
        """By term: its probes, the structure with it, and values: it absent, then each probe's."""
        out = []
        names = [q.name for q in self.plain]
        for name in dict.fromkeys(names):
            rows = [i for i, other in enumerate(names) if other == name]
            t = self.plain[rows[0]].term
            wide, null = with_term(self.problem.structure, self.values, t)
            out.append(
                (
                    rows, wide,
                    [null, *(np.append(self.values, self.plain[i].values) for i in rows)],
                )
            )  # fmt: skip
        return out

    def _changes(self, look: Evaluation) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(P, C, 3) accelerations, (P, E) and (P, B, 3) misreadings of the plain probes."""
        p = look.path
        out = np.zeros((len(self.plain), len(p.chunk), 3))
        m = np.zeros((len(self.plain), len(p.at.row)))
        m0 = np.zeros((len(self.plain), len(p.data.blocks), 3))
        for rows, wide, sets in self.sets:
            hooks = set(wide.terms[-1].effect.hooks)
            if hooks - {Stage.MEASURE}:
                out[rows] = forcing(p, wide, sets[1:], [bool(MOVES_THRUST & hooks)] * len(rows))
            if Stage.MEASURE in hooks:
                m[rows], m0[rows] = misreading(p, wide, sets)
        return out, m, m0

    def _unit(self, look: Evaluation, t: Term) -> np.ndarray:
        """(C, 3) rad/s² of what a scan scans: one unit of its torque at every instant."""
        p = look.path
        if t.effect.name == "mass.change":
            unit: tuple[float, ...] = (1.0, -1.0)
        else:
            t = term(f"disturbance.periodic.{AXES[t.axis_index]}")
            unit = (1.0, 0.0, np.pi / 2)
        wide, null = with_term(self.problem.structure, self.values, t)
        values = null.copy()
        values[len(self.values) :] = unit
        return np.asarray(forcing(p, wide, [values], [False])[0])


def with_term(structure: Structure, values: np.ndarray, t: Term) -> tuple[Structure, np.ndarray]:
    """The structure with one more term, and values of it with that term absent."""
    wide = replace(structure, terms=(*structure.terms, t))
    # An effect that is not there: a lag of zero, not its lowest bound.
    return wide, np.concatenate([values, [f.null for f in wide.free[len(values) :]]])


def traces(found: Estimate, probes: Sequence[Probe], data: Data, at: Pass) -> np.ndarray:
    """(P, E) δc of each probe by `follow` itself, not linearised: 15 ms a minute and probe."""
    from heli3dof.model.estimation.ekf_quantised import follow

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
