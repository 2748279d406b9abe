"""`check_distinct`: refuses equal training recordings, and hold-out data equal to one of them."""

from __future__ import annotations

from collections.abc import Sequence

from heli3dof.errors import UsageError
from heli3dof.recording.recording import Recording


def check_distinct(train: Sequence[Recording], holdout: Sequence[Recording]) -> None:
    """Raise UsageError if a recording in ``train`` has the same samples as another in either list.

    Names are not compared. Samples that are twice in ``train`` would count twice. Samples in both
    ``train`` and ``holdout`` would not be held out. Equal recordings in ``holdout`` are allowed.
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
