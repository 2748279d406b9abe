"""``timing.gaps``: samples that should be there and are not, or hold no number.

Counted from the stamps (`ticks`): lost_share = lost / (all that should be there). Its standard
deviation is that of a count of independent gaps of n_i samples each, √Σ n_i² / all.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heli3dof.diagnosis.integrity.base import Check, Fault, Kind, Stage
from heli3dof.diagnosis.integrity.view import View

SHARE, LEAST = 5e-4, 5
"""A finding takes this share, and this many lost samples; fewer are a note."""
HOPELESS = 0.3


def gaps(view: View) -> Iterable[Fault]:
    r = view.recording
    if len(r) < 20 or not (np.diff(r.t) > 0).all():
        return
    missing = np.diff(view.ticks.number) - 1
    sizes = [int(n) for n in missing[missing > 0]]
    columns = np.column_stack([r.voltage, r.angle])
    logged = columns[:, np.isfinite(columns).any(axis=0)]
    unread = int((~np.isfinite(logged)).any(axis=1).sum())
    lost = view.ticks.lost + unread
    if lost <= 0:
        return
    all_ = int(view.ticks.number[-1]) + 1
    share = lost / all_
    std = float(np.sqrt(sum(n * n for n in sizes) + unread)) / all_
    longest = max(sizes, default=0)
    kind = Kind.FINDING if share >= SHARE and lost >= LEAST else Kind.NOTE
    parts = [f"{lost} of {all_} samples are missing ({100 * share:.3g} %)"]
    if sizes:
        parts.append(
            f"in {len(sizes)} gap{'s' * (len(sizes) != 1)}, the longest "
            f"{1e3 * longest * view.ticks.period_s:.3g} ms"
        )
    if unread:
        parts.append(f"{unread} of them are rows without a finite value")
    yield Fault(
        "timing.gaps", Kind.BAD_DATA if share > HOPELESS else kind, r.name,
        f"{r.name}: {', '.join(parts)}.",
        "the link dropped samples, or the logging program was too slow; the voltage was held "
        "meanwhile.",
        "use another cable or port, or a faster disk; heli3dof run-step --roll 5 reports how many "
        "periods were late or missed",
        effect="timing.gaps", parameters={"lost_share": (share, std)},
        confidence=1.0 if kind == Kind.FINDING else 0.5,
    )  # fmt: skip


CHECKS = (Check("timing.gaps", Stage.CLOCK, "lost samples, or rows without a finite value", gaps),)
