"""Rao's score test of every candidate effect, without fitting any.

A probe is an effect with trial values of its parameters. It changes the filter's predictions c of E
encoder readings by δc (E,), computed with the filter's gains held fixed. Each reading has the
likelihood Z, the score g = ∂ ln Z/∂c and the information w = −∂² ln Z/∂c²; W = diag(w). θ (n,) are
the fitted parameters, with prior mean θ_0 and prior precision Λ. With T = ∂c/∂θ (n, E) and
A = T W Tᵀ + Λ,

    u = δc·g − (T W δc)ᵀ A⁻¹ (T g − Λ(θ − θ_0))        efficient score of the effect's size
    v = δc·W δc − (T W δc)ᵀ A⁻¹ (T W δc)               information on the effect's size
    z = u/√v                                           standard normal without the effect
    u/v                                                estimated size, in units of the trial size

The parts with A⁻¹ project out the fitted parameters, so a refit is not necessary.

u = Σ q δc is a weighted sum over the readings; `evaluation.efficient_score` gives the weights q. A
probe changes the model's accelerations by δa (rad/s²). One backward pass of the linearised filter
gives L, the derivative of Σ q δc with respect to δa at each time. Then u = Σ L·δa for every probe,
so u does not require δc of each probe (`bias_correction.perturbation`).

The likelihood is approximate, so z is biased; `search.nulls` standardises it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.diagnosis.search.catalogue import Probe
from heli3dof.identification.bias_correction.evaluation import Evaluation, efficient_score
from heli3dof.identification.bias_correction.perturbation import (
    MOVES_THRUST,
    backward,
    forcing,
    forward,
    misreading,
)
from heli3dof.identification.bias_correction.scans import (
    MIN_INFORMATION_SHARE,
    Scan,
    unit_acceleration,
)
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.model.effects import Term
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.model.physics.state_layout import Stage


@dataclass(frozen=True, eq=False)
class ScreenResult:
    """Score-test statistics z of P candidate effects, each with given values of its parameters.

    They are computed from the recordings, or from one null simulation: a flight simulated from the
    fitted model, without any of the candidates.
    """

    probes: tuple[Probe, ...]
    """First the effects with trial values that were chosen before the test. Then the effects that
    were tested at all frequencies or start times, each with the values that give the largest z"""
    z: np.ndarray
    """(P,) z = u/√v of the module docstring"""
    amplitude: np.ndarray
    """(P,) estimated distance of the first parameter from its null value, in its unit; NaN for a
    voltage limit"""


LEAST_INFORMATION = 1e-12
"""A probe is tested if v > `MIN_INFORMATION_SHARE` · max(δc W δc, this constant). The constant
excludes rounding errors: changes of the readings by less than 1e-9 of their noise. A wrong yaw zero
causes only these, because no prediction depends on it."""
Changes = tuple[list[int], np.ndarray, np.ndarray | None, np.ndarray | None]
"""How the n probes (trial values) of a term change the model: indices of the probes, changes of the
accelerations (n, C, 3) in C chunks of time, changes of the E readings (n, E), and changes of the
first readings in B blocks (n, B, 3). The last two are None if the effect changes no reading."""


class Screen:
    """Rao's score test of all candidate effects, at the parameters of one fit.

    `score` returns the test statistic z = u/√v of each effect. It tests the recordings, or a null
    simulation: a flight simulated from the fitted model, without any of the candidates. u is the
    efficient score of the tested flight, the derivative of its log-likelihood with respect to the
    effect's size. v is the Fisher information on this size. It is always that of the recordings.

    - ``recorded``: the Kalman filter's run over the recordings
    - ``probes``: candidate effects with trial values of their parameters
    - ``scans``: torques to test at every frequency or start time
    """

    def __init__(
        self, problem: Likelihood, theta: np.ndarray, recorded: Evaluation, probes: Sequence[Probe],
        scans: Sequence[Scan] = (),
    ) -> None:  # fmt: skip
        self.problem, self.theta = problem, theta
        self.scans = tuple(scans)
        self.plain = tuple(probes)
        self.values = problem.values(theta)
        self.sets = self._sets()
        self.D = np.zeros((len(self.plain), len(recorded.at.row)))
        """(P, E) changes δc of the E predicted readings by the P probes with fixed trial values"""
        for rows, a, m, m0 in self._changes(recorded):
            self.D[rows] = forward(recorded.path, a, m, m0)
        self.weight = recorded.at.w
        full = np.einsum("ij,j,ij->i", self.D, recorded.at.w, self.D)
        self.cross = cross = (recorded.T * recorded.at.w) @ self.D.T
        A = recorded.H + np.diag(problem.prior_precision)
        self.solved = np.linalg.solve(A, cross)
        v = full - np.einsum("ij,ij->j", cross, self.solved)
        testable = v > MIN_INFORMATION_SHARE * np.maximum(full, LEAST_INFORMATION)
        self.v = np.where(testable, v, np.inf)
        self.scan_informations = [
            s.information(recorded, self._unit(recorded, s), A) for s in self.scans
        ]

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names (P,) of the tested terms, one for each score.

        Terms with fixed trial values of their parameters come first. Terms that are tested at every
        frequency or start time follow.
        """
        return (*(p.name for p in self.plain), *(s.term.name for s in self.scans))

    def correlation(self, a: int, b: int) -> float:
        """Return the correlation ρ of the changes that two effects cause in the predicted readings.

        ``a`` and ``b`` are indices of `plain`, the tested effects with trial values of their
        parameters. Adding one of these effects to the model changes the predicted encoder readings.
        ρ ignores the part of each change that other values of the fitted parameters would produce.
        """
        full = float((self.D[a] * self.weight) @ self.D[b])
        projected = full - float(self.cross[:, a] @ self.solved[:, b])
        return projected / float(np.sqrt(self.v[a] * self.v[b]))

    def score(self, evaluation: Evaluation, *, prior: bool) -> ScreenResult:
        """Return the scores of all candidates in the recordings or in a null simulation.

        ``evaluation``: the filter's run over these data. Candidates with fixed trial values come
        first. Candidates that are tested at every frequency or start time follow. ``prior``: as in
        `efficient_score`.
        """
        q = efficient_score(self.problem, self.theta, evaluation, prior=prior)
        L, mu, z0 = backward(evaluation.path, q[None])
        u = np.zeros(len(self.plain))
        for rows, a, m, m0 in self._changes(evaluation):
            u[rows] = np.einsum("pci,ci->p", a, L[0])
            if m is not None and m0 is not None:
                u[rows] += m @ mu[0]
                u[rows] -= np.einsum("pbi,bi->p", m0, z0[0][:, :3] / evaluation.path.slope)
        root = np.sqrt(self.v)
        size = np.array([np.nan if p.size is None else p.size for p in self.plain])
        z, amplitude = [*(u / root)], [*(u / self.v * size)]
        probes = list(self.plain)
        for scan, information in zip(self.scans, self.scan_informations, strict=True):
            unit = self._unit(evaluation, scan)
            peak_z, values, time_shifts = scan.peak(evaluation, L[0], unit, information)
            z.append(peak_z)
            amplitude.append(values[0])
            probes.append(Probe(scan.term, values, time_shifts))
        return ScreenResult(tuple(probes), np.array(z), np.array(amplitude))

    def _sets(self) -> list[tuple[list[int], Structure, list[np.ndarray]]]:
        """Return for each term: indices of its probes, model with the term, values of parameters.

        A probe sets the term's parameters to trial values. With the first array of parameter
        values, the term has no effect. Each further array contains the trial values of one probe.
        """
        rows: dict[str, list[int]] = {}
        for i, p in enumerate(self.plain):
            rows.setdefault(p.name, []).append(i)
        out = []
        for of_term in rows.values():
            wide, null = with_term(self.problem.structure, self.values, self.plain[of_term[0]].term)
            values = [np.append(self.values, self.plain[i].values) for i in of_term]
            out.append((of_term, wide, [null, *values]))
        return out

    def _changes(self, evaluation: Evaluation) -> Iterator[Changes]:
        """Yield, for each term, how its trial values change the accelerations and the readings."""
        p = evaluation.path
        for rows, wide, sets in self.sets:
            hooks = set(wide.terms[-1].effect.hooks)
            a = np.zeros((len(rows), len(p.chunk), 3))
            if hooks - {Stage.MEASURE}:
                a = forcing(p, wide, sets[1:], [bool(MOVES_THRUST & hooks)] * len(rows))
            m, m0 = misreading(p, wide, sets) if Stage.MEASURE in hooks else (None, None)
            yield rows, a, m, m0

    def _unit(self, evaluation: Evaluation, scan: Scan) -> np.ndarray:
        return unit_acceleration(evaluation, self.problem.structure, self.values, scan.term)


def with_term(structure: Structure, values: np.ndarray, t: Term) -> tuple[Structure, np.ndarray]:
    """Return the model structure with the term ``t`` added, and values of all its parameters.

    The structure's own parameters keep their ``values``. The parameters of ``t`` have their null
    values, at which the term has no effect.
    """
    wide = structure.with_terms(t)
    # Absent is the null value (a lag of zero), not the lower bound.
    return wide, np.concatenate([values, [f.null for f in wide.free[len(values) :]]])
