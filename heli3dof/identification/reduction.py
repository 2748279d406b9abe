"""Simplify fitted transfer functions until every remaining factor is significant.

G is the fitted transfer function from the sum or the difference of the two motor voltages to one
angle. A simplification H of G is accepted if, at all frequencies ω of a grid,

    |H(jω) − G(jω)| ≤ L(ω),     L = max(2 σ, `ROUNDING`·G_max),     σ² = var Re G + var Im G

Then the recordings do not distinguish H from G. If σ is unknown, L is `ROUNDING`·G_max. G_max(ω) is
the larger modulus of two transfer functions: those from the front motor's voltage and from the back
motor's voltage to the same angle. There are five simplifications:

* The whole transfer function becomes zero.
* A zero moves to infinity: its factor of the numerator is omitted.
* A real pole beyond the grid moves to infinity. Its time constant is shorter than 10 ms or 0.4
  sampling intervals, whichever is longer.
* A pole and a zero cancel.
* The roots of a factor move to the origin, if all coefficients of the factor are zero within two
  standard deviations. The same applies to the product of two first-order factors.

H has a gain k and factors s + a or s² + b s + c of the numerator and the denominator
(`heli3dof.identification.factored_transfer_function`). k is fitted again after each simplification.
If several simplifications are possible, the one with the smallest maximum of |H − G|/L over the
grid is applied. Roots move to the origin only after no other simplification is possible.

If the moved roots are poles, 1/H is compared with 1/G, because 1/G is linear in the coefficients of
the denominator. The standard deviation of 1/G is σ/|G|².

Let θ be the coefficients of the fitted polynomials (numerators and denominator), with the
covariance P. Let φ be the gain and all coefficients a, b, c of H. With the derivatives S = ∂G/∂θ
and J = ∂H/∂φ on the grid, and the weights W = 1/L², a weighted least-squares fit of H to G gives

    δφ = (Jᴴ W J)⁻¹ Jᴴ W S δθ = M δθ,    cov φ = M P Mᵀ
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from heli3dof.axes import AXES
from heli3dof.identification.factored_transfer_function import Factor, FactoredTransferFunction
from heli3dof.identification.fit_result import Pole
from heli3dof.identification.transfer_function import TransferFunctions
from heli3dof.parallel import one_blas_thread

INPUTS = {"sum": np.array([1.0, 1.0]), "difference": np.array([1.0, -1.0])}
"""Input → change (2,) of the front and back voltage in V for one unit of the input"""
LOWEST, HIGHEST = 0.1, 100.0
"""rad/s: range of the grid. A flight of one minute has no information below it (a convention)."""
NYQUIST_SHARE = 0.8
"""Highest frequency of the grid as a share of π/T, with the sampling interval T of the fit"""
POINTS = 120
ROUNDING = 1e-6
"""Relative change of a response that counts as rounding; computing poles from a sixth-order
polynomial with double precision changes the response by less"""
SIGMAS = 2.0
"""Standard deviations within which two responses count as equal, about 95 % (a convention)"""


@one_blas_thread
def factored(
    transfer: TransferFunctions, interval_s: float | None = None, poles: Sequence[Pole] = ()
) -> tuple[FactoredTransferFunction, ...]:
    """Return the simplified transfer functions from the voltages to the angles, in factors.

    The inputs are the sum and the difference of the voltages. The result is sorted by angle (roll,
    pitch, yaw), then by input (sum, difference). ``interval_s``: the sampling interval of the fit.
    It limits the frequencies at which the simplified and the fitted response must agree; if it is
    None, the limit is `HIGHEST`. ``poles``: the poles of ``transfer``. Their standard deviations
    are used in the denominators' factors.
    """
    highest = HIGHEST if interval_s is None else min(HIGHEST, NYQUIST_SHARE * np.pi / interval_s)
    s = 1j * np.geomspace(LOWEST, highest, POINTS)
    channels = [_Channel(transfer, i, name, s, poles) for i in transfer.shown for name in INPUTS]
    return tuple(c.simplified() for c in channels)


class _Channel:
    """One of the six transfer functions: from the voltages' sum or difference to an angle.

    G is the fitted frequency response at ``s`` = jω (F,) rad/s, in rad/V. A simplification H is
    accepted if |H − G| ≤ ``limit`` (F,) at all frequencies.
    """

    def __init__(
        self,
        transfer: TransferFunctions,
        axis: int,
        name: str,
        s: np.ndarray,
        poles: Sequence[Pole],
    ) -> None:
        k = len(transfer.den)
        weights = INPUTS[name]
        self.axis, self.name, self.s, self.poles = axis, name, s, poles
        self.num, self.den = transfer.num[axis].T @ weights, transfer.den
        powers = s[:, None] ** np.arange(k - 1, -1, -1)
        D = powers @ self.den
        self.G = powers @ self.num / D
        self.covariance = transfer.covariance
        self.S = np.zeros((len(s), k - 1 + transfer.num.size), dtype=complex)
        self.S[:, : k - 1] = -self.G[:, None] * powers[:, 1:] / D[:, None]
        for motor, w in enumerate(weights):
            first = k - 1 + (2 * axis + motor) * k
            self.S[:, first : first + k] = w * powers / D[:, None]
        self.limit = ROUNDING * np.abs(powers @ transfer.num[axis].T / D[:, None]).max(axis=1)
        if transfer.covariance is not None:
            P = transfer.covariance
            var = sum(
                np.einsum("fi,ij,fj->f", part, P, part, optimize=True)
                for part in (self.S.real, self.S.imag)
            )
            self.limit = np.maximum(self.limit, SIGMAS * np.sqrt(np.maximum(var, 0)))

    def simplified(self) -> FactoredTransferFunction:
        """Return the transfer function after all accepted simplifications (see the module)."""
        H = FactoredTransferFunction(AXES[self.axis], self.name, 0.0, np.nan, (), ())
        if np.all(np.abs(self.G) <= self.limit):
            return H
        lead = np.flatnonzero(np.abs(self.num) > 1e-9 * np.abs(self.num).max())[0]
        numerator, denominator = self.rounded(self.num[lead:]), self.rounded(self.den)
        H, _ = self.refitted(replace(H, numerator=numerator, denominator=denominator))
        while (nearest := self.nearest(_with_fewer_factors(H, abs(self.s[-1])))) is not None:
            H = nearest
        H = self.with_std(H)

        def with_moved_poles(H: FactoredTransferFunction) -> Iterator[FactoredTransferFunction]:
            moved = _with_roots_at_origin(H.denominator)
            return (replace(H, denominator=factors) for factors in moved)

        def with_moved_zeros(H: FactoredTransferFunction) -> Iterator[FactoredTransferFunction]:
            moved = _with_roots_at_origin(H.numerator)
            return (replace(H, numerator=factors) for factors in moved)

        while (nearest := self.nearest(with_moved_poles(H), poles=True)) is not None:
            H = self.with_std(nearest)
        while (nearest := self.nearest(with_moved_zeros(H))) is not None:
            H = self.with_std(nearest)
        return H

    def rounded(self, polynomial: np.ndarray) -> tuple[Factor, ...]:
        """Return a polynomial's factors, with rounding errors removed from its roots.

        The coefficients of ``polynomial`` start with the highest power. Roots that differ from 0
        only by rounding become 0. A conjugate pair that differs from a double real root only by
        rounding becomes this double root.
        """
        roots = np.roots(polynomial)
        roots = roots[np.argsort(np.abs(roots))]

        def same(other: np.ndarray) -> bool:
            change = np.polyval(np.poly(other), self.s) / np.polyval(polynomial, self.s)
            return bool(np.all(np.abs(change * polynomial[0] - 1) < ROUNDING))

        for m in range(len(roots), 0, -1):
            at_zero = np.concatenate([np.zeros(m), roots[m:]])
            if same(at_zero):
                roots = at_zero
                break
        for root in roots[np.imag(roots) > 0]:
            double = np.where(
                np.isclose(roots, root) | np.isclose(roots, root.conj()), root.real, roots
            )
            if same(double):
                roots = double
        return tuple(_factor(r) for r in roots if np.imag(r) >= 0)

    def refitted(
        self, H: FactoredTransferFunction, *, poles: bool = False
    ) -> tuple[FactoredTransferFunction, float]:
        """Return H with its gain fitted to the response G, and the maximum of |H − G|/``limit``.

        G is the fitted transfer function, H a simplification of G. ``limit`` is the largest
        insignificant |H − G| at each frequency. So a maximum above 1 means that H and G differ
        significantly. The gain is fitted by least squares with the weights 1/``limit``².
        ``poles``: True if the simplification moved poles of H to the origin. Then 1/H is compared
        with 1/G, with the limit ``limit``/|G|².
        """
        shape = replace(H, gain=1.0).at(self.s)
        w = 1 / self.limit**2
        gain = float(np.sum(w * np.conj(shape) * self.G).real / np.sum(w * np.abs(shape) ** 2))
        deviation = np.abs(gain * shape - self.G) / self.limit
        if poles:
            deviation *= np.abs(self.G / (gain * shape))
        return replace(H, gain=gain), float(deviation.max())

    def nearest(
        self, candidates: Iterator[FactoredTransferFunction], *, poles: bool = False
    ) -> FactoredTransferFunction | None:
        """Return the candidate with the smallest deviation from the fitted response G, or None.

        `refitted` fits the candidate's gain and computes the deviation. A candidate whose deviation
        exceeds 1 differs significantly from G. If all candidates do, the result is None. ``poles``:
        True if poles of the candidates were moved to the origin.
        """
        best, least = None, 1.0
        for H, deviation in (self.refitted(H, poles=poles) for H in candidates):
            if deviation <= least:
                best, least = H, deviation
        return best

    def with_std(self, H: FactoredTransferFunction) -> FactoredTransferFunction:
        """Return H with the standard deviations of gain and coefficients."""
        if self.covariance is None:
            return H
        response = H.at(self.s)
        columns = [response / H.gain]
        for sign, factors in ((1, H.numerator), (-1, H.denominator)):
            for f in factors:
                n = len(f.coefficients)
                if any(f.coefficients):
                    columns += [
                        sign * response * self.s**p / f.at(self.s) for p in range(n - 1, -1, -1)
                    ]
        w = 1 / self.limit[:, None]
        J, S = w * np.column_stack(columns), w * self.S
        M = np.linalg.lstsq(np.vstack([J.real, J.imag]), np.vstack([S.real, S.imag]), rcond=None)[0]
        std = iter(np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", M, self.covariance, M), 0)))
        gain_std = float(next(std))

        def known(factors: Sequence[Factor]) -> tuple[Factor, ...]:
            return tuple(
                replace(f, std=tuple(float(next(std)) for _ in f.coefficients))
                if any(f.coefficients)
                else replace(f, std=(0.0,) * len(f.coefficients))
                for f in factors
            )

        numerator = known(H.numerator)
        H = replace(H, gain_std=gain_std, numerator=numerator, denominator=known(H.denominator))
        return _with_pole_std(H, self.poles)


def _with_pole_std(H: FactoredTransferFunction, poles: Sequence[Pole]) -> FactoredTransferFunction:
    """Return H; the standard deviations of its denominator are computed from those of ``poles``.

    Computed from H alone, they would be larger, because all six transfer functions together
    determine the common poles. A pole pair α ± jβ has the factor s² + b s + c with b = −2α and
    c = α² + β². The covariance of α and β is neglected.
    """
    if not poles:
        return H

    def known(f: Factor) -> Factor:
        root = max(f.roots, key=np.imag)
        pole = min(poles, key=lambda p: abs(p.value - root))
        if not any(f.coefficients):
            return f
        if len(f.coefficients) == 1:
            return replace(f, std=(pole.std_real,))
        c_std = 2 * np.hypot(root.real * pole.std_real, root.imag * pole.std_imag)
        return replace(f, std=(2 * pole.std_real, float(c_std)))

    return replace(H, denominator=tuple(map(known, H.denominator)))


def _with_fewer_factors(
    H: FactoredTransferFunction, highest: float
) -> Iterator[FactoredTransferFunction]:
    """Yield each variant of the transfer function H that lacks a pole, a zero, or one of each.

    - A real pole is removed if it is beyond ``highest`` (rad/s), and if the denominator's degree
      then still exceeds the numerator's.
    - Every factor of the numerator is removed, in a variant of its own.
    - A factor of the numerator and one of the denominator are removed together (they cancel) if
      both have the same order, 1 or 2.
    """
    excess = _degree(H.denominator) - _degree(H.numerator)
    for j, pole in enumerate(H.denominator):
        if excess > 1 and len(pole.coefficients) == 1 and pole.coefficients[0] > highest:
            yield replace(H, denominator=H.denominator[:j] + H.denominator[j + 1 :])
    for i, zero in enumerate(H.numerator):
        fewer = replace(H, numerator=H.numerator[:i] + H.numerator[i + 1 :])
        yield fewer
        for j, pole in enumerate(H.denominator):
            if len(pole.coefficients) == len(zero.coefficients):
                yield replace(fewer, denominator=H.denominator[:j] + H.denominator[j + 1 :])


def _degree(factors: Sequence[Factor]) -> int:
    return sum(len(f.coefficients) for f in factors)


def _with_roots_at_origin(factors: tuple[Factor, ...]) -> Iterator[tuple[Factor, ...]]:
    """Yield variants of the factors of a polynomial, with one or two roots moved to 0.

    A numerator or denominator is a product of ``factors`` s + a or s² + b s + c. If all
    coefficients of a factor are within `SIGMAS` standard deviations of 0, there is a variant with s
    or s² instead of this factor.

    The product s² + b s + c of any two factors s + a is tested, too (`_product`). If b and c are
    within `SIGMAS` standard deviations of 0, there is a variant with s² instead of both factors.
    The reason is a product s² + k with k near 0. Its roots are ±√−k, for which the delta method
    gives no valid standard deviation. So a test of the single factors would not be valid.
    """
    zero = Factor((0.0,), (0.0,))
    real = [i for i, f in enumerate(factors) if len(f.std) == 1 and any(f.coefficients)]
    products = {ij: _product(*(factors[i] for i in ij)) for ij in combinations(real, 2)}
    for which, f in ({(i,): f for i, f in enumerate(factors)} | products).items():
        near = (abs(c) <= SIGMAS * s for c, s in zip(f.coefficients, f.std, strict=True))
        if any(f.coefficients) and all(near):
            others = (g for i, g in enumerate(factors) if i not in which)
            yield (*others, *[zero] * len(f.coefficients))


def _product(f: Factor, g: Factor) -> Factor:
    """Return (s + a₁)(s + a₂) as s² + b s + c, with upper bounds of the standard deviations.

    From b = a₁ + a₂, c = a₁ a₂ and |cov(a₁, a₂)| ≤ σ₁ σ₂ follow σ_b ≤ σ₁ + σ₂ and
    σ_c ≤ |a₁| σ₂ + |a₂| σ₁.

    Example: the polynomial s² + k with k < 0 has a₁ = √−k, a₂ = −√−k and c = k. If k has the
    standard deviation σ_k, then σ₁ = σ₂ = σ_k/(2√−k). The upper bound of σ_c is then exactly σ_k.
    """
    (a1,), (a2,), (s1,), (s2,) = f.coefficients, g.coefficients, f.std, g.std
    return Factor((a1 + a2, a1 * a2), (s1 + s2, abs(a1) * s2 + abs(a2) * s1))


def _factor(root: complex) -> Factor:
    """Return the factor s + a of a real root, or s² + b s + c of a root and its conjugate."""
    if np.imag(root) == 0:
        return Factor((-float(np.real(root)) + 0.0,), (np.nan,))
    return Factor((-2 * float(np.real(root)), float(abs(root) ** 2)), (np.nan, np.nan))
