"""Which terms of a rig that was fitted whole are *named* as causes, and which are only kept.

With θ̂ ± σ the first number of a term and θ_0 its absence, the chance that the size is no zero is

    P = erf(|θ̂ − θ_0| / (σ √2))

and for a number that differs by recording that of the χ² of all its values. A term is a named cause
where blocks left out need it (`free_run.elimination`, or it is known beforehand to be
there), P is at least `SURE`, σ is at most `LITTLE` of the prior's, and both halves of the flights
show it, of one size (`free_run.halves`; what is known beforehand must be of one size
only). The others stay in the extended model, within what is known of such rigs: dry friction of
some size is in every joint, and a term at exactly zero predicts worse, on flights that move what
these did not, than one at a size that is likely.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from heli3dof.diagnosis.free_run.elimination import Elimination, Removal, known_beforehand, traded
from heli3dof.diagnosis.free_run.halves import deviations, seen
from heli3dof.diagnosis.outlook import Open
from heli3dof.identification.greybox.multistep import MultiStepFit
from heli3dof.model.greybox.model import GreyBoxModel

SURE = 0.95
LITTLE = 0.7
"""σ over the prior's: from there on the recordings have said little."""
MOSTLY_PRIOR = "the recordings say little of its size: its interval is mostly that of the prior"


def apart(fit: MultiStepFit, name: str) -> float:
    """P of the term's first number; 1 where it has no absence."""
    found = deviations(fit, name)
    return 1.0 if found is None else math.erf(abs(found[0]) / math.sqrt(2))


def named(found: Elimination) -> tuple[list[Removal], list[Removal]]:
    """(causes, what is only kept), each in its order."""
    sure = [
        r for r in found.kept if apart(found.fit, r.term) >= SURE and not contradicted(found, r)
    ]
    return sure, [*(r for r in found.kept if r not in sure), *found.gone]


def mostly_prior(fit: MultiStepFit, name: str) -> bool:
    """Return whether the recordings said little of the term's first number: σ > `LITTLE` σ_prior.

    A prior whose mean is far from the term's absence would name it whatever was recorded.
    """
    free = fit.structure.free
    j = next((j for j, f in enumerate(free) if f.term == name), None)
    if j is None or free[j].name in fit.problem.varying:
        return False
    return bool(fit.std[j] > LITTLE * fit.prior_std[j])


def contradicted(found: Elimination, r: Removal) -> str:
    """Why the recordings do not bear that name; empty where they do."""
    if mostly_prior(found.fit, r.term):
        return MOSTLY_PRIOR
    halves = seen(found.halves, r.term)
    if halves is None:
        return ""
    if not halves.one_size:
        return "the two halves of the data give it different sizes"
    if halves.by_both or r.term in known_beforehand(found.fit.problem):
        return ""
    return "it is not significant in each half of the data"


def certainty(found: Elimination, r: Removal) -> float:
    """That a named cause is there: the lesser of P and the share of draws in which blocks need it.

    What is known beforehand to be there rests on P alone.
    """
    size = apart(found.fit, r.term)
    return size if r.term in known_beforehand(found.fit.problem) else min(r.worse.positive, size)


def left_open(
    found: Elimination, model: GreyBoxModel, causes: list[Removal], only_kept: list[Removal]
) -> Open:
    """What a further flight should settle: the first tie; else what blocks need whose size, or
    whose place in both halves, is not sure; else what was not seen at all."""
    for r in causes:
        if r.tied_with:
            return Open(found.fit, model, (r.term, *r.tied_with), tied=True)
    needed = [r.term for r in only_kept if r not in found.gone]
    return Open(found.fit, model, tuple(needed or unseen(found.fit, causes)))


def within(found: Elimination, only_kept: list[Removal]) -> list[dict[str, Any]]:
    """JSON-able: each such term, its size beside what was known of it, and why it is no cause."""
    varying = {v.rsplit(".", 1)[0] for v in found.fit.problem.varying}
    as_what = "with one value per recording: "
    return [
        {
            "term": r.term,
            "parameters": sizes(found.fit, r.term),
            "why": as_what * (r.term in varying) + _why(found, r),
        }
        for r in only_kept
    ]


def _why(found: Elimination, r: Removal) -> str:
    if mostly_prior(found.fit, r.term):
        return MOSTLY_PRIOR
    if not found.halves:
        return "its size is not significant, and no blocks were left out"
    if r in found.gone:
        return "left-out blocks do not need it"
    if apart(found.fit, r.term) >= SURE and (why := contradicted(found, r)):
        return f"left-out blocks need it, but {why}"
    alike = ", ".join(traded(found.fit, r.term))
    other = f" or a similar term ({alike})" if alike else ""
    return f"left-out blocks need it{other}, but its size is not significant"


def sizes(fit: MultiStepFit, name: str) -> dict[str, dict[str, float | str]]:
    """Parameter → value and deviation, before (mean, deviation) and after, in ``unit``."""
    p = fit.problem
    out: dict[str, dict[str, float | str]] = {}
    prior = p.start[: p.n]
    for j, f in enumerate(fit.structure.free):
        if f.term == name:
            out[f.name.removeprefix(f"{name}.")] = {
                "value": float(fit.values[j]),
                "std": float(fit.std[j]),
                "prior_mean": float(f.outward(prior[j])),
                "prior_std": float(fit.prior_std[j]),
                "unit": f.unit,
            }
    return out


def unseen(fit: MultiStepFit, causes: list[Removal]) -> Iterator[str]:
    """Terms without a name of which the recordings said little: what they cannot show."""
    here = {r.term for r in causes}
    for t in fit.structure.terms:
        mine = [
            s > LITTLE * p
            for f, s, p in zip(fit.structure.free, fit.std, fit.prior_std, strict=True)
            if f.term == t.name and f.name not in fit.problem.varying
        ]
        if mine and all(mine) and t.name not in here:
            yield t.name
