"""`check_distinct`: raises an error if a training recording shares samples with another recording.

The other recording may be a training recording or a held-out recording.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from heli3dof.errors import UsageError
from heli3dof.recording.recording import Recording, rounded

CHANGES = 50
"""Consecutive equal samples with at least this many changes of an angle are the same data. Between
them, the rig was still. Two flights agree in so many changes only if one seed made both: about 1 s
of motion at 500 Hz. Chosen, not derived."""


def check_distinct(train: Sequence[Recording], holdout: Sequence[Recording]) -> None:
    """Raise UsageError if a recording in ``train`` shares samples with another in either list.

    Names are not compared. Samples that are twice in ``train`` would count twice. Samples in both
    ``train`` and ``holdout`` would not be held out. ``holdout`` may contain samples twice.
    """
    names = {r.digest: r.name for r in train}
    for r in holdout:
        if r.digest in names:
            raise UsageError(
                f"{r.name} contains the same samples as training recording {names[r.digest]}, so "
                "it cannot be used as hold-out data.",
                cause="the same recording, or a copy of it, is also given as training data.",
                fix="hold out another flight (heli3dof run rich --seed 2 makes one), or omit the "
                "hold-out data: the gain is then cross-validated",
            )
    if len(names) < len(train):
        raise UsageError(
            f"The same samples are given twice among {', '.join(r.name for r in train)}.",
            cause="a recording was given twice, or one is a copy of another.",
            fix="give every flight once",
        )
    for one, other, role in _pairs(train, holdout):
        if (span := _shared_span(one, other)) is not None:
            raise UsageError(
                f"Training recording {one.name} and {role} recording {other.name} share the "
                f"samples from t = {span[0]:.6g} s to {span[1]:.6g} s.",
                cause="they are parts of one flight that overlap.",
                fix="choose parts that do not overlap: recording.between(0, 40) and "
                "recording.between(40, 60); or another flight",
            )


def _pairs(
    train: Sequence[Recording], holdout: Sequence[Recording]
) -> Iterator[tuple[Recording, Recording, str]]:
    """Yield each pair to compare: a training recording, another recording, and the other's role.

    The role is "training" or "held-out". Each pair of training recordings occurs once.
    """
    for k, one in enumerate(train):
        yield from ((one, other, "training") for other in train[k + 1 :])
        yield from ((one, other, "held-out") for other in holdout)


def _shared_span(one: Recording, other: Recording) -> tuple[float, float] | None:
    """Return the first and last time (s) of the samples that both recordings contain, or None.

    The function compares samples at equal times. It returns the first series of consecutive equal
    samples in which an angle changes at least `CHANGES` times.

    Two emulated flights with one seed are equal at the start, until their plans differ. Therefore
    the function ignores equal samples at the start of both recordings if different samples follow.
    It does not ignore them if one recording ends before the first difference.
    """
    times, i, j = np.intersect1d(rounded(one.t), rounded(other.t), return_indices=True)
    equal = np.ones(len(times), dtype=bool)
    changed = np.zeros(len(times), dtype=bool)
    for array in ("voltage", "angle"):
        a, b = (rounded(getattr(r, array)[rows]) for r, rows in ((one, i), (other, j)))
        equal &= ((a == b) | (np.isnan(a) & np.isnan(b))).all(axis=1)
        if array == "angle":
            changed[1:] = (np.diff(np.nan_to_num(a), axis=0) != 0).any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], equal, [False])).astype(int)))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        is_start_of_both = i[start] == 0 and j[start] == 0
        is_end_of_one = i[stop - 1] == len(one) - 1 or j[stop - 1] == len(other) - 1
        if is_start_of_both and not is_end_of_one:
            continue
        if np.count_nonzero(changed[start:stop]) >= CHANGES:
            return float(times[start]), float(times[stop - 1])
    return None
