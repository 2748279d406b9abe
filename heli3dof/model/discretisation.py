"""Convert linear models between continuous and discrete time, and to transfer functions.

Zero-order hold with the sample interval dt (s)::

    [A_d B_d]        ( [A B]    )
    [ 0   I ]  = exp ( [0 0] dt )        (`c2d_zoh`; `d2c_zoh` inverts it)

The inverse needs a real matrix logarithm. A discrete pole at zero (a delay) or on the negative real
axis (an oscillation at half the sample rate) has none. In these cases `continuous` uses the
bilinear rule z = (1 + s dt/2)/(1 − s dt/2), whose result has a feedthrough D.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import scipy.linalg as la

if TYPE_CHECKING:
    import control

    from heli3dof.model.linear.model import LinearModel

_NAMES = {"inputs": ["v_front_V", "v_back_V"], "outputs": ["roll_rad", "pitch_rad", "yaw_rad"]}
HOVER_STATES = ("r", "p", "psi", "r_rate", "p_rate", "psi_rate")
"""Names of the states (r, p, ψ, ṙ, ṗ, ψ̇) of the paper's eq (8), in rad and rad/s."""


@dataclass(frozen=True, eq=False)
class Continuous:
    """The model ẋ = A x + B ũ, ỹ = C x + D ũ; ũ (V) and ỹ (rad) are deviations from the trim.

    ``method`` states how this model was computed from a discrete-time model: ``hold``, by the
    inverse of the zero-order hold (exact at the samples), or ``bilinear``.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    method: Literal["hold", "bilinear"]

    def response(self, omega: np.ndarray) -> np.ndarray:
        """Return the frequency response C (jωI − A)⁻¹ B + D (F, 3, 2) rad/V at ω (F,) rad/s."""
        eye = np.eye(len(self.A))
        inner = (np.linalg.solve(1j * w * eye - self.A, self.B) for w in omega)
        return np.array([self.C @ x + self.D for x in inner])

    def coefficients(self) -> np.ndarray:
        """Return all transfer functions' coefficients in one array: den[1:], then num.ravel().

        num and den are the results of `numerators`.
        """
        num, den = numerators(self)
        return np.concatenate([den[1:], num.ravel()])


def c2d_zoh(A: np.ndarray, B: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (A_d, B_d), the exact discretisation of ẋ = A x + B u with u held for dt (s)."""
    n, m = B.shape
    M = np.zeros((n + m, n + m))
    M[:n, :n], M[:n, n:] = A, B
    E = la.expm(M * dt)
    return E[:n, :n], E[:n, n:]


def d2c_zoh(A_d: np.ndarray, B_d: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the continuous-time (A, B) whose zero-order hold over dt (s) is (A_d, B_d).

    Returns None if A_d has an eigenvalue at zero or on the negative real axis, or if the matrix
    logarithm is not real.
    """
    z: np.ndarray = np.linalg.eigvals(A_d)
    if np.any((z.real <= 0) & (abs(z.imag) <= 1e-9 * np.maximum(1, abs(z)))):
        return None
    n, m = B_d.shape
    M = np.zeros((n + m, n + m))
    M[:n, :n], M[:n, n:] = A_d, B_d
    M[n:, n:] = np.eye(m)
    L = la.logm(M) / dt
    if np.iscomplexobj(L):
        if abs(L.imag).max() > 1e-6 * max(1.0, abs(L.real).max()):
            return None
        L = L.real
    return L[:n, :n], L[:n, n:]


def continuous(model: LinearModel) -> Continuous:
    """Return a model converted to continuous time: its field ``sampled_from`` unless that is None.

    Otherwise the conversion is the inverse zero-order hold. If this does not exist, it is the
    bilinear rule (Tustin).
    """
    if model.sampled_from is not None:
        return model.sampled_from
    zoh = d2c_zoh(model.A, model.B, model.dt)
    if zoh is not None:
        return Continuous(*zoh, model.C, np.zeros((3, 2)), "hold")
    # z = (1 + s dt/2)/(1 − s dt/2), with P = (A_d + I)⁻¹
    eye = np.eye(len(model.A))
    P = la.pinv(model.A + eye)
    A = (2 / model.dt) * P @ (model.A - eye)
    B = (2 / np.sqrt(model.dt)) * P @ model.B
    C = (2 / np.sqrt(model.dt)) * model.C @ P
    return Continuous(A, B, C, -model.C @ P @ model.B, "bilinear")


def numerators(model: Continuous) -> tuple[np.ndarray, np.ndarray]:
    """Return the transfer functions' numerators and their common denominator: (num, den).

    num[i, j]/den is the transfer function from motor j (V) to axis i (rad). With n states, num has
    the shape (3, 2, n + 1), and den (n + 1,) contains det(sI − A). In both, the
    coefficient of the highest power of s is first. Without feedthrough, the numerator is
    det(sI − A + B_j C_i) − det(sI − A), with column j of B and row i of C. A feedthrough D adds
    D_ij · den.
    """
    den = np.real(np.poly(model.A))
    num = np.zeros((3, 2, len(den)))
    for i in range(3):
        for j in range(2):
            closed = np.real(np.poly(model.A - np.outer(model.B[:, j], model.C[i])))
            num[i, j] = closed - den + model.D[i, j] * den
    return num, den


def to_control(
    model: LinearModel, *, in_continuous_time: bool = False, states: Sequence[str] | None = None
) -> control.StateSpace:
    """Return a python-control ``StateSpace`` about the trim: from u − u0 (V) to y − y0 (rad).

    u are the motor voltages, y the angles; u0, y0: trim. The result is discrete at the model's
    sample interval, or in continuous time (see `continuous`). ``states`` are the states' names.
    A bilinear conversion mixes the states; the result's states are then named x[0], x[1], …
    """
    import control

    names = {**_NAMES, "name": model.name}
    if not in_continuous_time:
        D = np.zeros((3, 2))
        return control.ss(model.A, model.B, model.C, D, model.dt, states=states, **names)
    c = continuous(model)
    if c.method == "bilinear":
        states = None
    return control.ss(c.A, c.B, c.C, c.D, states=states, **names)


def to_transfer_function(model: LinearModel) -> control.TransferFunction:
    """Return the continuous-time transfer functions, rad per V, as a 3 × 2 python-control object.

    Common powers of s are cancelled, unlike in `numerators`.
    """
    import control

    num, den = numerators(continuous(model))
    pairs = [[_reduced(num[i, j], den) for j in range(2)] for i in range(3)]
    return control.tf(
        [[pair[0] for pair in row] for row in pairs],
        [[pair[1] for pair in row] for row in pairs],
        name=model.name,
        **_NAMES,
    )


def _reduced(num: np.ndarray, den: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (num, den) of a transfer function without leading zeros and common powers of s."""
    num = np.where(abs(num) > 1e-12 * np.max(abs(den)), num, 0.0)
    if not num.any():
        return np.zeros(1), np.ones(1)
    num = np.trim_zeros(num, "f")
    while len(num) > 1 and num[-1] == 0 and abs(den[-1]) <= 1e-12 * np.max(abs(den)):
        num, den = num[:-1], den[:-1]
    return num, den
