"""Report ``timing.gaps``: lost samples, and rows with a value that is not finite.

A gap of `HOLE_S` or more is a hole. The check reports holes in a separate note, and does not count
their samples as lost. Outside the holes, n samples were due (`View.sampling_clock`). n_i of them
are lost in gap i, and u have a value that is not finite.

    lost_share = (Σ n_i + u)/n

If the gaps are independent, the standard deviation of lost_share is √(Σ n_i² + u)/n.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from heli3dof.integrity.base import Check, Fault, Kind, Stage
from heli3dof.integrity.remedies import is_log
from heli3dof.integrity.view import View
from heli3dof.recording.gap_filling import HOLE_S
from heli3dof.recording.logs.log_validation import MAX_LOST_SHARE

SHARE, LEAST = 5e-4, 5
"""Least share and number of lost samples of a finding; fewer are a note. Chosen."""
LOGGED = (
    "the logging program was too slow, or its link dropped samples.",
    "log fewer signals, or to a faster disk",
)
FLOWN = (
    "the link dropped samples, or the disk was too slow; the voltage was held meanwhile.",
    "use another cable or port, or a faster disk; heli3dof run-step --roll 5 reports how many "
    "periods were late or skipped",
)
"""Cause and remedy for a log of another program, and for a recording of heli3dof"""


def gaps(view: View) -> Iterable[Fault]:
    r = view.recording
    if len(r) < 20 or not (np.diff(r.t) > 0).all():
        return
    missing, holes = view.sampling_clock.missing, np.diff(r.t) >= HOLE_S
    if holes.any():
        each = (f"from {r.t[k]:.1f} to {r.t[k + 1]:.1f} s" for k in np.flatnonzero(holes))
        yield Fault(
            "timing.hole", Kind.NOTE, r.name, f"{r.name}: no samples {' and '.join(each)}.",
            "the log was cut or joined, or the link was down. The parts before and after are used "
            "as separate intervals.",
            "",
        )  # fmt: skip
    sizes = [int(n) for n in missing[(missing > 0) & ~holes]]
    columns = np.column_stack([r.voltage, r.angle])
    logged = columns[:, np.isfinite(columns).any(axis=0)]
    incomplete = int((~np.isfinite(logged)).any(axis=1).sum())
    in_holes = int(missing[holes].sum())
    lost = view.sampling_clock.lost - in_holes + incomplete
    if lost <= 0:
        return
    expected = int(view.sampling_clock.number[-1]) + 1 - in_holes
    share = lost / expected
    std = float(np.sqrt(sum(n * n for n in sizes) + incomplete)) / expected
    kind = Kind.FINDING if share >= SHARE and lost >= LEAST else Kind.NOTE
    parts = [f"{lost} of {expected} samples are missing ({100 * share:.3g} %)"]
    if sizes:
        parts.append(
            f"in {len(sizes)} gap{'s' * (len(sizes) != 1)}, the longest interval between samples "
            f"is {np.diff(r.t)[(missing > 0) & ~holes].max():.3g} s"
        )
    if incomplete:
        parts.append(f"{incomplete} of them are rows with a value that is not finite")
    yield Fault(
        "timing.gaps", Kind.BAD_DATA if share > MAX_LOST_SHARE else kind, r.name,
        f"{r.name}: {', '.join(parts)}.", *(LOGGED if is_log(r) else FLOWN),
        effect="timing.gaps", parameters={"lost_share": (share, std)},
        confidence=1.0 if kind == Kind.FINDING else 0.5, allowed_for=True,
    )  # fmt: skip


CHECKS = (
    Check(
        "timing.gaps", Stage.CLOCK, "lost samples, non-finite values, gaps above 1 s", gaps,
        ("timing.gaps", "timing.hole"),
    ),
)  # fmt: skip
