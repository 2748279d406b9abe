"""Continuous-time transfer functions over a common denominator, printed like the paper's eq (17).

    T(s)_{i,j} = N_ij(s) / D(s),      i = 1 front, 2 back;  j = 1 roll, 2 pitch, 3 yaw

D is monic. Numerators are stored in rad/V and printed in degrees/V. Each coefficient has a standard
deviation. The standard deviation of a zero z follows from N(z) = Σ_k n_k z^{ν−k} = 0, with ν the
highest power:

    ∂z = −Σ_k z^{ν−k} ∂n_k / N′(z)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from heli3dof.axes import AXES, MOTORS
from heli3dof.model.control.closed_loop_poles import rightmost_first

DEGREES = float(np.rad2deg(1.0))


@dataclass(frozen=True, eq=False)
class TransferFunctions:
    """Transfer functions from the two motors to the three angles over a common denominator.

    num (3, 2, k) are the numerators in rad/V, by axis and motor; den (k,) is monic. The coefficient
    of the highest power comes first. ``covariance`` (q, q) is that of the coefficients
    [den[1:], num.ravel()]; None if unknown.
    """

    num: np.ndarray
    den: np.ndarray
    covariance: np.ndarray | None = None
    still: tuple[str, ...] = ()
    """Axes that did not move in the recordings: their transfer functions are not shown."""

    @property
    def std(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the standard deviations of num and den, in their shapes; NaN where unknown."""
        k = len(self.den)
        if self.covariance is None:
            return np.full(self.num.shape, np.nan), np.full(k, np.nan)
        std = np.sqrt(np.maximum(np.diag(self.covariance), 0))
        return std[k - 1 :].reshape(self.num.shape), np.concatenate([[0.0], std[: k - 1]])

    @property
    def shown(self) -> list[int]:
        """Return the indices of the axes that moved."""
        return [i for i, axis in enumerate(AXES) if axis not in self.still]

    def zeros(self, axis: int, motor: int) -> list[tuple[complex, float]]:
        """Return (zero, standard deviation) in rad/s for each zero of num[axis, motor].

        The rightmost zero comes first. The standard deviation is √(var Re + var Im); NaN for a
        double zero, or if the covariance is unknown.
        """
        n = _without_rounding(self.num[axis, motor], float(np.abs(self.num[axis]).max()))
        k = len(self.den)
        out = []
        for z in rightmost_first(np.roots(n)):
            std = np.nan
            slope = np.polyval(np.polyder(n), z)
            if self.covariance is not None and slope != 0:
                first = k - 1 + (axis * 2 + motor + 1) * k - len(n)
                cov = self.covariance[first : first + len(n), first : first + len(n)]
                g = -(z ** np.arange(len(n) - 1, -1, -1)) / slope
                var = g.real @ cov @ g.real + g.imag @ cov @ g.imag
                std = float(np.sqrt(max(var, 0)))
            out.append((complex(z), std))
        return out

    def response(self, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the frequency response (F, 3, 2) in rad/V, and its standard deviation.

        ``omega`` (F,) are the F frequencies in rad/s. The response is G = N/D at s = jω, with the
        polynomials N = Σ_k n_k s^{ν−k} and D = Σ_k d_k s^{μ−k}. Errors ∂n_k, ∂d_k of the
        coefficients change G by

            ∂G = Σ_k s^{ν−k} ∂n_k / D − G Σ_k s^{μ−k} ∂d_k / D

        The standard deviation is √(var Re G + var Im G); NaN if the covariance is unknown.
        """
        k, m = len(self.den), self.num.shape[2]
        s = 1j * np.asarray(omega, dtype=float)
        D = np.polyval(self.den, s)
        powers = s[:, None] ** np.arange(max(k, m) - 1, -1, -1)  # (F, max(k, m))
        G = np.einsum("fk,abk->fab", powers[:, -m:], self.num) / D[:, None, None]
        if self.covariance is None:
            return G, np.full(G.shape, np.nan)
        std = np.empty(G.shape)
        for a, b in np.ndindex(G.shape[1:]):
            first = k - 1 + (a * G.shape[2] + b) * m
            rows = [*range(k - 1), *range(first, first + m)]
            cov = self.covariance[np.ix_(rows, rows)]
            by_den = -G[:, a, b, None] * powers[:, -(k - 1) :]
            slope = np.hstack([by_den, powers[:, -m:]]) / D[:, None]
            var = np.einsum("fi,ij,fj->f", slope.real, cov, slope.real)
            var += np.einsum("fi,ij,fj->f", slope.imag, cov, slope.imag)
            std[:, a, b] = np.sqrt(np.maximum(var, 0))
        return G, std

    def lines(self) -> list[str]:
        """Return lines of text, each of them a transfer function in degrees/V."""
        den = polynomial(self.den)
        out = []
        for j in range(2):
            for i in self.shown:
                num = polynomial(self.num[i, j] * DEGREES, float(np.abs(self.num[i]).max()))
                out.append(f"T(s)_{{{j + 1},{i + 1}}} = ({num}) / ({den})")
        return out

    def to_json(self) -> dict[str, Any]:
        """Return coefficients (degrees/V) and zeros (rad/s), both with standard deviations."""
        num_std, den_std = self.std
        entries = []
        for j, motor in enumerate(MOTORS):
            for i in self.shown:
                entries.append(
                    {
                        "input": f"v_{motor}_V",
                        "output": f"{AXES[i]}_deg",
                        "numerator": (self.num[i, j] * DEGREES).tolist(),
                        "numerator_std": (num_std[i, j] * DEGREES).tolist(),
                        "zeros": [
                            {"re_per_s": z.real, "im_per_s": z.imag, "std_per_s": s}
                            for z, s in self.zeros(i, j)
                        ],
                    }
                )
        return {
            "unit": "deg/V",
            "denominator": self.den.tolist(),
            "denominator_std": den_std.tolist(),
            "entries": entries,
            "printed": self.lines(),
        }


def polynomial(coefficients: np.ndarray, scale: float = 0.0) -> str:
    """Return a polynomial in s as text, with 4 digits; ``coefficients``: highest power first.

    A leading coefficient is omitted as a rounding error if it is below 1e-9 times the larger of two
    numbers: the largest coefficient and ``scale``.

    >>> polynomial(np.array([1.0, 1.379, 2.01, -1.072, 0.3533]))
    's^4 + 1.379s^3 + 2.01s^2 - 1.072s + 0.3533'
    """
    c = _without_rounding(np.asarray(coefficients, dtype=float), scale)
    terms: list[str] = []
    for power, value in zip(range(len(c) - 1, -1, -1), c, strict=True):
        if value == 0 and len(c) > 1:
            continue
        size = f"{abs(value):.4g}"
        letter = "" if power == 0 else "s" if power == 1 else f"s^{power}"
        body = letter if letter and size == "1" else size + letter
        sign = "-" if value < 0 else "+"
        terms.append(
            body if not terms and value >= 0 else f"-{body}" if not terms else f"{sign} {body}"
        )
    return " ".join(terms) if terms else "0"


def _without_rounding(c: np.ndarray, scale: float) -> np.ndarray:
    big = np.flatnonzero(np.abs(c) > 1e-9 * max(scale, float(np.abs(c).max()), 1e-300))
    return c[big[0] :] if len(big) else np.zeros(1)
