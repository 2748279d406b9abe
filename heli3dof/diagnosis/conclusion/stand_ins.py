"""Names that were only standing in for something that has none.

A torque outside the catalogue is first seen by whatever term is most like it, and that term's name
would be taken. What tells the two apart is the leftover: beside the free-form torques found there
(J of them, `unmodelled.unmodelled_torque`) one Gauss–Newton step of everything at once,

    δ = A⁻¹ (g − ḡ),       v' = v + δ_v,       Z'² = (v' − null)² / (A⁻¹)_vv

A, g of the fit's coordinates and of the free-form torques, says what is left of the term's first
parameter v. A cause that is there keeps its size beside a leftover of another shape; a stand-in
loses it: Z'² falls below `KEPT` of what Z² was without the leftover, and v' below `SIZE` of v. One
that keeps its size but not its Z² these recordings cannot tell from the leftover: "…-like".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.result import Finding
from heli3dof.diagnosis.unmodelled.torque_evidence import Held
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.gain import pays
from heli3dof.identification.greybox.estimate import Estimate

KEPT = 0.25
"""Of Z²"""
SIZE = 0.6
"""Of the parameter"""
VAGUE = 2.0
SMALLEST = 0.01
"""Of T_g, which a step must not turn round"""


@dataclass(frozen=True)
class WithResidual:
    """A term's first parameter away from absent, without and beside the leftover."""

    name: str
    size: float
    Z2: float
    size_beside: float
    Z2_beside: float

    @property
    def stands_in(self) -> bool:
        """True where the leftover takes its place."""
        shrunk = self.size_beside * np.sign(self.size) < SIZE * abs(self.size)
        return bool(shrunk and self.unsure)

    @property
    def unsure(self) -> bool:
        """True where the leftover takes most of its evidence."""
        return self.Z2_beside < KEPT * self.Z2


def sizes_with_residual(found: Estimate, held: Held) -> tuple[WithResidual, ...]:
    """Every term of the fit, beside what is ``held`` after its leftovers were taken."""
    n = len(found.optimum.theta)
    g = centred(held)
    inverse = np.linalg.pinv(held.A, hermitian=True)
    alone = np.linalg.inv(held.A[:n, :n])
    step, step_alone = inverse @ g, alone @ g[:n]
    out = []
    for t in found.structure.terms:
        j = next((i for i, f in enumerate(found.free) if f.term == t.name), None)
        if j is None:  # a simpler base's own, without a number
            continue
        f, v = found.free[j], float(found.values[j])
        per = f.slope(v)
        size, size_ = (v + per * float(d[j]) - f.null for d in (step_alone, step))
        var, var_ = (per**2 * float(m[j, j]) for m in (alone, inverse))
        out.append(WithResidual(t.name, size, size**2 / var, size_, size_**2 / var_))
    return tuple(out)


def base_with_residual(found: Estimate, held: Held) -> tuple[np.ndarray, np.ndarray]:
    """(4,), (4,): ln of T_g and the inertias beside the leftovers over what they are in the fit,
    and its standard deviation."""
    inverse = np.linalg.pinv(held.A, hermitian=True)
    per = found.slopes[:4] / found.values[:4]  # ∂ ln v/∂θ
    step = per * (inverse @ centred(held))[:4]
    log = np.array([f.log for f in found.free[:4]])
    return (
        np.where(log, step, np.log(np.maximum(1 + step, SMALLEST))),
        np.abs(per) * np.sqrt(np.diag(inverse)[:4]),
    )


def stand_ins(
    findings: Sequence[Finding], found: Estimate, left: Sequence[ResidualTorque], held: Held
) -> tuple[str, ...]:
    """The findings whose place the leftovers take; none where nothing is left."""
    if not left:
        return ()
    named = {f.choice.term.name for f in findings if not f.choice.term.effect.of_base}
    return tuple(
        b.name for b in sizes_with_residual(found, held) if b.stands_in and b.name in named
    )


def marked_unsure(
    findings: Sequence[Finding], found: Estimate, left: Sequence[ResidualTorque], held: Held
) -> tuple[Finding, ...]:
    """The findings; "…-like" those that the leftovers make unsure, and those that data not seen do
    not surely confirm (a first cause is adopted where it is likelier there, see `measured`), or
    whose size is less than `VAGUE` standard deviations from nothing, or that were weak already."""
    unsure = {b.name for b in sizes_with_residual(found, held) if b.unsure} if left else set()
    unsure |= vague(found)
    return tuple(
        replace(f, like=f.choice.weak or f.choice.term.name in unsure or not pays(f.gain))
        for f in findings
    )


def vague(found: Estimate) -> set[str]:
    """Terms whose first number may as well be that of their absence."""
    first = {f.term: j for j, f in reversed(list(enumerate(found.free))) if f.term is not None}
    return {
        name
        for name, j in first.items()
        if not found.free[j].log
        and abs(float(found.values[j]) - found.free[j].null) < VAGUE * float(found.std[j])
    }


def centred(held: Held) -> np.ndarray:
    """(p,) g − ḡ"""
    return held.g if not len(held.g_null) else held.g - held.g_null.mean(axis=0)


def with_resemblance(
    left: Sequence[ResidualTorque], names: Sequence[str]
) -> tuple[ResidualTorque, ...]:
    """The first leftover says which name it had taken, unless it is like another."""
    if not left or left[0].like is not None or not names:
        return tuple(left)
    return (replace(left[0], like=f"{names[0]}-like"), *left[1:])
