"""Select the rows of a recording that a grey-box model is fitted to."""

from __future__ import annotations

import numpy as np

from heli3dof.identification.row_selection import stretches, unusable
from heli3dof.model.estimation.filter_data import LOST, RowRange
from heli3dof.recording.recording import Recording

LEAST_RUN_S = 0.5
"""s: shortest run of usable rows that is fitted. Chosen; not derived."""


def usable_runs(recording: Recording, source: int) -> list[RowRange]:
    """Return the stretches of usable rows of a recording, each at least `LEAST_RUN_S` s long.

    A stretch ends at a gap of more than `LOST` periods. ``source`` is the recording's index.
    """
    bad = np.logical_or.reduce(list(unusable(recording).values()))
    breaks = np.flatnonzero(np.diff(recording.t) > LOST * recording.dt) + 1
    least = LEAST_RUN_S / recording.dt
    return [RowRange(source, a, b) for a, b in stretches(~bad, breaks) if b - a >= least]
