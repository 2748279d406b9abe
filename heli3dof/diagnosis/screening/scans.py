"""Scans: a torque of every frequency by one Fourier transform, of every instant by one running sum.

With L the adjoint of the efficient score and e(t) the accelerations that a unit torque makes,
λ(t) = L·e is the efficient score of a unit torque at that instant, and

    u(f) = Σ λ(t) exp(i 2π f t)            of τ_0 cos, and of τ_0 sin, at every frequency at once
    u(t_0) = Σ_{t ≥ t_0} λ(t)              of a torque that sets in at t_0

Their informations v are followed at some frequencies or instants and interpolated between.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from heli3dof.diagnosis.estimate.evaluation import Evaluation
from heli3dof.diagnosis.sensitivity.perturbation import forward
from heli3dof.model.effects import Term

LOWEST_HZ, HIGHEST_HZ = 0.08, 8.0
KNOTS = 9
BIN_S = 0.02
INSTANT_S = 0.05
Scale = tuple[np.ndarray, np.ndarray]
"""Where, and the information there."""


class Scan(Protocol):
    """What can be looked for everywhere at once."""

    @property
    def term(self) -> Term: ...

    def scale(self, here: Evaluation, unit: np.ndarray, A: np.ndarray) -> Scale:
        """The informations of a unit's traces, from the recordings; ``unit`` (C, 3)."""
        ...

    def peak(
        self, look: Evaluation, L: np.ndarray, unit: np.ndarray, scale: Scale
    ) -> tuple[float, tuple[float, ...], float]:
        """(z at its highest, the parameters' values there, the first one's amount)."""
        ...


def _informations(here: Evaluation, a: np.ndarray, A: np.ndarray) -> np.ndarray:
    """(J,) of the changes a (J, C, 3), the base's part taken out."""
    D = forward(here.path, a)
    cross = (here.T * here.at.w) @ D.T
    full = np.einsum("ij,j,ij->i", D, here.at.w, D)
    v = full - np.einsum("ij,ij->j", cross, np.linalg.solve(A, cross))
    return np.asarray(np.where(v > 1e-6 * np.maximum(full, 1e-30), v, np.nan))


@dataclass(frozen=True)
class Frequencies:
    """A torque τ_0 sin(2π f t + φ) of any f."""

    term: Term

    def scale(self, here: Evaluation, unit: np.ndarray, A: np.ndarray) -> Scale:
        t = here.path.t
        length = max(float(np.ptp(t)), 1.0)
        f = np.geomspace(max(LOWEST_HZ, 2.0 / length), HIGHEST_HZ, KNOTS)
        phase = 2 * np.pi * f[:, None] * t
        both = np.concatenate([np.cos(phase), np.sin(phase)])
        v = _informations(here, both[:, :, None] * unit, A).reshape(2, KNOTS)
        return f, np.where(np.isfinite(v).all(axis=0), v.mean(axis=0), np.inf)

    def peak(
        self, look: Evaluation, L: np.ndarray, unit: np.ndarray, scale: Scale
    ) -> tuple[float, tuple[float, ...], float]:
        knots, v = scale
        t = look.path.t
        bins = np.round((t - t.min()) / BIN_S).astype(np.int64)
        score = np.bincount(bins, np.einsum("ci,ci->c", L, unit))
        n = 1 << int(np.ceil(np.log2(4 * len(score))))
        f = np.fft.rfftfreq(n, BIN_S)
        u = np.conj(np.fft.rfft(score, n)) * np.exp(2j * np.pi * f * t.min())
        inside = (f >= knots[0]) & (f <= knots[-1])
        f, u = f[inside], u[inside]
        ok = np.isfinite(v)
        if not ok.any():
            return 0.0, (0.0, 1.0, 0.0), 0.0
        info = np.exp(np.interp(np.log(f), np.log(knots[ok]), np.log(v[ok])))
        power = np.abs(u) ** 2 / info
        k = int(np.argmax(power))
        # u = Σ λ (cos + i sin): of sin(2πft + φ), cos φ is the sine's share, sin φ the cosine's.
        amount = float(np.abs(u[k]) / info[k])
        phi = float(np.arctan2(u[k].real, u[k].imag))
        return float(np.sqrt(power[k])), (amount, float(f[k]), phi), amount


@dataclass(frozen=True)
class Instants:
    """Something that is put on during the flight."""

    term: Term

    def scale(self, here: Evaluation, unit: np.ndarray, A: np.ndarray) -> Scale:
        t = here.path.t
        when = np.linspace(t.min(), t.max(), KNOTS + 4)[1:-1]
        v = _informations(here, (t >= when[:, None])[:, :, None] * unit, A)
        return when, np.where(np.isfinite(v), v, np.inf)

    def peak(
        self, look: Evaluation, L: np.ndarray, unit: np.ndarray, scale: Scale
    ) -> tuple[float, tuple[float, ...], float]:
        when, v = scale
        t = look.path.t
        ok = np.isfinite(v)
        if not ok.any():
            return 0.0, (0.0, 0.0), 0.0
        lo, hi = float(when[ok][0]), float(when[ok][-1])
        starts = np.arange(lo, hi, INSTANT_S)
        order = np.argsort(t, kind="stable")
        score = np.einsum("ci,ci->c", L, unit)[order]
        after = np.append(np.cumsum(score[::-1])[::-1], 0.0)
        u = after[np.searchsorted(t[order], starts)]
        info = np.interp(starts, when[ok], v[ok])
        z2 = u**2 / info
        k = int(np.argmax(z2))
        amount = float(u[k] / info[k])
        return float(np.sqrt(z2[k])), (amount, float(starts[k])), amount
