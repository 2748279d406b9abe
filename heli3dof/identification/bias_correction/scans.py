"""Score test for a torque of unknown frequency, and for a torque that starts at an unknown instant.

One Fourier transform gives the scores at all frequencies, one running sum those at all instants.
Time is divided into C short chunks. L (C, 3) is the derivative of the log-likelihood with respect
to the acceleration of each axis in each chunk. L does not contain the part that the fitted
parameters can explain (`diagnosis.search.score_test`). e (C, 3) is the acceleration (rad/s²) that a
unit torque causes. λ(t) = L·e, a sum over the axes, is the efficient score of a unit torque in the
chunk at time t. The score u of the whole torque is

    u(f) = Σ λ(t) exp(i 2π f t)      at frequency f; real part: cosine, imaginary part: sine torque
    u(t_0) = Σ_{t ≥ t_0} λ(t)        for a torque that starts at the instant t_0

The Fisher information v on the torque is computed at a few f or t_0 and interpolated. The result is
the largest z² = |u|²/v.

A periodic torque may have a different phase φ_r in each of R recordings. Let u_r and v_r be the
parts of u and v from recording r. Without a torque, S = Σ_r |u_r|²/v_r is χ² with 2 R degrees of
freedom. `equivalent_z2` converts S to the z² with the same p-value for 2 degrees of freedom:

    z² = S − 2 ln Σ_{k < R} (S/2)^k/k!

If (φ_r − φ_1)/(2π f) is added to the time of each recording r, the torque has the phase φ_1 in all
recordings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.identification.bias_correction.evaluation import (
    Evaluation,
    efficient_score,
    evaluate,
)
from heli3dof.identification.bias_correction.perturbation import backward, forcing, forward
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.model.effects import Term, term
from heli3dof.model.physics.parametrisation import Structure

MIN_INFORMATION_SHARE = 1e-6
"""Least share of an effect's information that must remain with the fit's parameters projected out:
with less, these parameters change the readings as the effect does."""
ACCURACY_S = 0.05
"""s, accuracy of an instant: half the time in which an added mass takes effect."""
LOWEST_HZ, HIGHEST_HZ = 0.08, 8.0
"""Limits of the scanned frequencies. The lowest is raised until the recordings contain two periods.
Chosen; not derived."""
SCAN_KNOTS = 9
"""v is computed at so many frequencies, and at two more instants. Chosen; not derived."""
BIN_S = 0.02
"""Sampling period of λ for the Fourier transform. Chosen."""
Information = tuple[np.ndarray, np.ndarray]
"""(K,) knots in Hz or s, and (K,) v at the knots"""


Peak = tuple[float, tuple[float, ...], tuple[float, ...]]
"""The result of a scan: the largest standardised score z; the parameters of the effect with this
score, its size first; and a time shift (s) for each recording. After the shifts are added to the
recordings' times, the phase is the same in all. () means that no shift is needed."""


def _informations(evaluation: Evaluation, a: np.ndarray, A: np.ndarray) -> np.ndarray:
    """Return the Fisher information v (J,) on the size of each of J torques.

    v is the information that remains if the n parameters of the fit are estimated together with the
    size. It is NaN for a torque that is indistinguishable from a change of these parameters. ``A``
    (n, n) is the information matrix of the parameters, including the prior's information. ``a`` (J,
    C, 3) are the accelerations (rad/s²) that each torque of size 1 causes in each of C chunks
    (short time intervals).
    """
    D = forward(evaluation.path, a)
    cross = (evaluation.T * evaluation.at.w) @ D.T
    full = np.einsum("ij,j,ij->i", D, evaluation.at.w, D)
    v = full - np.einsum("ij,ij->j", cross, np.linalg.solve(A, cross))
    return np.asarray(np.where(v > MIN_INFORMATION_SHARE * np.maximum(full, 1e-30), v, np.nan))


@dataclass(frozen=True)
class Frequencies:
    """The score test for a torque τ_0 sin(2π f t + φ), at each frequency f of a grid."""

    term: Term

    def information(self, evaluation: Evaluation, unit: np.ndarray, A: np.ndarray) -> Information:
        """Return K frequencies (Hz), and the information v (K,) on a torque of each frequency.

        v is the Fisher information on the torque's amplitude, averaged over a cosine and a sine
        torque. It is the information that remains if the n parameters of the fit are estimated
        together with the amplitude. At some frequencies, the torque may be indistinguishable from a
        change of the parameters. There, v is set to inf as a mark for "no value", and `peak`
        interpolates between the other frequencies. ``A`` (n, n) is the information matrix of the
        parameters, including the prior's information. ``unit`` (C, 3) are the accelerations
        (rad/s²) that a constant torque of 1 N·m causes in each of C chunks (short time intervals).
        """
        t = evaluation.path.t
        length = max(float(np.ptp(t)), 1.0)
        f = np.geomspace(max(LOWEST_HZ, 2.0 / length), HIGHEST_HZ, SCAN_KNOTS)
        phase = 2 * np.pi * f[:, None] * t
        both = np.concatenate([np.cos(phase), np.sin(phase)])
        v = _informations(evaluation, both[:, :, None] * unit, A).reshape(2, SCAN_KNOTS)
        return f, np.where(np.isfinite(v).all(axis=0), v.mean(axis=0), np.inf)

    def peak(
        self, evaluation: Evaluation, L: np.ndarray, unit: np.ndarray, information: Information
    ) -> Peak:
        """Return the largest standardised score of a sinusoidal torque of any frequency (`Peak`).

        The result also contains the amplitude (N·m), the frequency (Hz) and the phase (rad) of the
        torque with this score. If there are several recordings, the torque may have a different
        phase in each. Therefore the result contains a time shift (s) for each recording. After
        these shifts are added to the recordings' times, the torque has the same phase in all.

        Time is divided into C short intervals. ``L`` (C, 3) are the derivatives of the
        log-likelihood with respect to the acceleration of each axis in each interval. They do not
        contain the part that the fitted parameters can explain. ``unit`` (C, 3) are the
        accelerations (rad/s²) that a constant torque of 1 N·m causes. ``information`` is the result
        of the method `information`.
        """
        knots, v = information
        t, source = evaluation.path.t, evaluation.path.source
        bins = np.round((t - t.min()) / BIN_S).astype(np.int64)
        n = 1 << int(np.ceil(np.log2(4 * (bins.max() + 1))))
        f = np.fft.rfftfreq(n, BIN_S)
        inside = (f >= knots[0]) & (f <= knots[-1])
        f = f[inside]
        ok = np.isfinite(v)
        if not ok.any():
            return 0.0, (0.0, 1.0, 0.0), ()
        v_at_f = np.exp(np.interp(np.log(f), np.log(knots[ok]), np.log(v[ok])))
        score = np.einsum("ci,ci->c", L, unit)
        u = np.zeros((source.max() + 1, len(f)), dtype=complex)  # a row for each recording
        for r in np.unique(source):
            of_r = np.bincount(bins, np.where(source == r, score, 0.0))
            u[r] = np.conj(np.fft.rfft(of_r, n)[inside]) * np.exp(2j * np.pi * f * t.min())
        share = np.bincount(source, minlength=len(u)) / len(source)
        used = share > 0
        S = (np.abs(u[used]) ** 2 / (share[used, None] * v_at_f)).sum(axis=0)
        k = int(np.argmax(S))
        total = float(np.abs(u[:, k]).sum())
        # sin(2πft + φ) = cos φ · sine + sin φ · cosine; u = Σ λ (cos + i sin).
        phi = np.arctan2(u[:, k].real, u[:, k].imag)
        phase = float(phi[source[0]])
        ahead = (phi - phase) % (2 * np.pi) / (2 * np.pi * f[k])
        R = int(used.sum())
        time_shifts = tuple(map(float, ahead)) if R > 1 else ()
        values = (total / float(v_at_f[k]), float(f[k]), phase)
        return float(np.sqrt(equivalent_z2(float(S[k]), R))), values, time_shifts


def equivalent_z2(S: float, R: int) -> float:
    """Return the z² that has the same p-value as S, the sum of the test statistics of R recordings.

    Under the null hypothesis, S is χ² with 2 R degrees of freedom, and z² is χ² with 2.

    >>> equivalent_z2(30.0, 1)
    30.0
    >>> from scipy.stats import chi2
    >>> bool(np.isclose(chi2.sf(equivalent_z2(40.0, 4), 2), chi2.sf(40.0, 8)))
    True
    """
    k = np.arange(R)
    terms = k * np.log(max(S, 1e-300) / 2) - np.cumsum(np.log(np.maximum(k, 1)))
    return max(float(S - 2 * np.logaddexp.reduce(terms)), 0.0)


@dataclass(frozen=True)
class Instants:
    """The score test for a mass that is added in flight, at each instant t_0 of a grid."""

    term: Term

    def information(self, evaluation: Evaluation, unit: np.ndarray, A: np.ndarray) -> Information:
        """Return K instants (s), and the information v (K,) on a mass added at each instant.

        v is the Fisher information (1/kg²) that remains if the n parameters of the fit are
        estimated together with the mass. At some instants, the mass may be indistinguishable from a
        change of the parameters. There, v is set to inf as a mark for "no value", and `peak`
        interpolates between the other instants. ``A`` (n, n) is the information matrix of the
        parameters, including the prior's information. ``unit`` (C, 3) are the accelerations
        (rad/s²) that an added mass of 1 kg causes in each of C chunks (short time intervals).
        """
        t = evaluation.path.t
        when = np.linspace(t.min(), t.max(), SCAN_KNOTS + 4)[1:-1]
        v = _informations(evaluation, (t >= when[:, None])[:, :, None] * unit, A)
        return when, np.where(np.isfinite(v), v, np.inf)

    def peak(
        self, evaluation: Evaluation, L: np.ndarray, unit: np.ndarray, information: Information
    ) -> Peak:
        """Return the largest standardised score of a mass that is added in flight (`Peak`).

        The function tests a grid of instants at which the mass may be added. The result also
        contains the mass (kg) and the instant (s) with the largest score. ``unit`` (C, 3) are the
        accelerations (rad/s²) that an added mass of 1 kg causes in each of C short time intervals.
        The other arguments are those of `Frequencies.peak`.
        """
        when, v = information
        t = evaluation.path.t
        ok = np.isfinite(v)
        if not ok.any():
            return 0.0, (0.0, 0.0), ()
        low, high = float(when[ok][0]), float(when[ok][-1])
        starts = np.arange(low, high, ACCURACY_S)
        order = np.argsort(t, kind="stable")
        score = np.einsum("ci,ci->c", L, unit)[order]
        after = np.append(np.cumsum(score[::-1])[::-1], 0.0)
        u = after[np.searchsorted(t[order], starts)]
        v_at_start = np.interp(starts, when[ok], v[ok])
        z2 = u**2 / v_at_start
        k = int(np.argmax(z2))
        amount = float(u[k] / v_at_start[k])
        return float(np.sqrt(z2[k])), (amount, float(starts[k])), ()


Scan = Frequencies | Instants
"""A score test of one effect at all frequencies, or at all instants at which it may begin"""


def unit_acceleration(
    evaluation: Evaluation, structure: Structure, values: np.ndarray, t: Term
) -> np.ndarray:
    """Return the accelerations (C, 3) rad/s² that one unit of the effect ``t`` causes.

    There is one row for each of C chunks (short time intervals), into which ``evaluation`` divides
    the flights. If the effect is an added mass (``mass.change``), the unit is 1 kg. Otherwise the
    effect is a periodic torque, and the unit is a constant torque of 1 N·m on its axis. ``values``
    are the parameter values of the ``structure``, a model without ``t``.
    """
    if t.effect.name == "mass.change":
        unit: tuple[float, ...] = (1.0, -1.0)
    else:
        t = term(f"disturbance.periodic.{AXES[t.axis_index]}")
        unit = (1.0, 0.0, np.pi / 2)
    wide = structure.with_terms(t)
    return np.asarray(forcing(evaluation.path, wide, [np.append(values, unit)], [False])[0])


def likeliest_instant(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, t: Term
) -> tuple[float, ...]:
    """Return size and instant of an effect ``t`` that begins at an unknown instant.

    The function tests ``t`` at a grid of instants by its score (the log-likelihood's derivative).
    It returns the instant with the largest standardised score, and the size that is estimated
    there. ``problem`` is the likelihood of the model without ``t``. The scaled parameters ``theta``
    (n,) and the ``noise`` (4,) maximise it.
    """
    e = evaluate(problem, theta, noise, with_noise_derivatives=False)
    A = e.H + np.diag(problem.prior_precision)
    L, _, _ = backward(e.path, efficient_score(problem, theta, e, prior=True)[None])
    unit = unit_acceleration(e, problem.structure, problem.values(theta), t)
    scan = Instants(t)
    return scan.peak(e, L[0], unit, scan.information(e, unit, A))[1]
