"""A transfer function as gain and factors, printed with the coefficients' standard deviations.

    G(s) = k · Π (s + a_i) Π (s² + b_i s + c_i) / [ Π (s + a_j) Π (s² + b_j s + c_j) ]

The gain k is in rad/V/s^m, with m the number of poles minus the number of zeros.
`heli3dof.identification.reduction` computes the factors of a fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from heli3dof.identification.transfer_function import DEGREES

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class Factor:
    """A factor s + a or s² + b s + c: coefficients (a,) or (b, c), and standard deviations."""

    coefficients: tuple[float, ...]
    std: tuple[float, ...]
    """Standard deviation of each coefficient: NaN if unknown, 0 for a root at the origin"""

    @property
    def roots(self) -> np.ndarray:
        return np.roots([1.0, *self.coefficients])

    def at(self, s: np.ndarray) -> np.ndarray:
        """Return the factor's values at the complex frequencies ``s`` (F,) rad/s."""
        first, *others = self.coefficients
        value = s + first  # Horner's scheme, several times faster here than `np.polyval`
        for c in others:
            value = value * s + c
        return np.asarray(value)

    def __str__(self) -> str:
        """Return text such as ``(s+10.03±0.17)`` or ``(s²+(0.054±0.039)s+1.114±0.047)``.

        The text contains no space, so that a line of text breaks between factors only.
        """
        text = "s" if len(self.coefficients) == 1 else "s²"
        if not any(self.coefficients):
            return text
        *linear, constant = zip(self.coefficients, self.std, strict=True)
        for value, std in linear:
            size = _with_std(abs(value), std)
            text += f"{_sign(value)}{f'({size})' if '±' in size else size}s" if value else ""
        value, std = constant
        return f"({text}{_sign(value)}{_with_std(abs(value), std)})" if value else f"({text})"

    def to_json(self) -> dict[str, Any]:
        return {"coefficients": [1.0, *self.coefficients], "std": [0.0, *self.std]}


@dataclass(frozen=True)
class FactoredTransferFunction:
    """A transfer function from ``input`` (V) to the angle ``output`` (rad): gain and factors.

    One unit of ``input`` is a change of both voltages by +1 V (``sum``), or of the front voltage by
    +1 V and the back voltage by −1 V (``difference``). A gain of 0 means that the angle does not
    respond to the input within the accuracy of the fit.
    """

    output: str
    input: str
    gain: float
    gain_std: float
    numerator: tuple[Factor, ...]
    denominator: tuple[Factor, ...]

    def __str__(self) -> str:
        """Return the transfer function in degrees/V, each coefficient with its standard deviation.

        The factors are in the order of the modulus of their roots, the smallest first.
        """
        if self.gain == 0:
            return "0"
        sign = "−" if self.gain < 0 else ""
        parts = [sign + _with_std(abs(self.gain) * DEGREES, self.gain_std * DEGREES)]
        parts += _factors(self.numerator)
        below = _factors(self.denominator)
        if not below:
            return " ".join(parts)
        bottom = below[0] if len(below) == 1 else f"[{' '.join(below)}]"
        return f"{' '.join(parts)} / {bottom}"

    def at(self, s: np.ndarray) -> np.ndarray:
        """Return the response in rad/V at the complex frequencies ``s`` (F,) rad/s."""
        G = np.full(np.shape(s), self.gain, dtype=complex)
        for f in self.numerator:
            G = G * f.at(s)
        for f in self.denominator:
            G = G / f.at(s)
        return G

    def to_control(self) -> control.TransferFunction:
        """Return the transfer function in rad/V as a python-control object."""
        import control

        zeros = [r for f in self.numerator for r in f.roots]
        poles = [r for f in self.denominator for r in f.roots]
        return control.zpk(
            zeros, poles, self.gain, inputs=f"v_{self.input}_V", outputs=f"{self.output}_rad"
        )

    def to_json(self) -> dict[str, Any]:
        """Return a dict of gain (angle in degrees) and factors, with standard deviations."""
        return {
            "input": self.input,
            "output": self.output,
            "gain": self.gain * DEGREES,
            "gain_std": self.gain_std * DEGREES,
            "numerator": [f.to_json() for f in self.numerator],
            "denominator": [f.to_json() for f in self.denominator],
            "printed": str(self),
        }


def _factors(factors: Sequence[Factor]) -> list[str]:
    """Return the factors as texts; equal factors become one power, such as ``(s+10.03)²``."""
    ordered = sorted(factors, key=lambda f: abs(f.coefficients[-1]) ** (1 / len(f.coefficients)))
    texts = [str(f) for f in ordered]
    powers = {2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶"}
    return [
        t + powers.get(texts.count(t), "" if texts.count(t) == 1 else f"^{texts.count(t)}")
        for t in dict.fromkeys(texts)
    ]


def _sign(value: float) -> str:
    return "−" if value < 0 else "+"


def _with_std(value: float, std: float) -> str:
    """Return text such as ``99.66±0.32``: the standard deviation, if known, has two digits."""
    if not np.isfinite(std) or std <= 0:
        return f"{value:.4g}"
    digits = 1 - int(np.floor(np.log10(std)))
    shown = max(digits, 0)
    return f"{round(value, digits):.{shown}f}±{round(std, digits):.{shown}f}"
