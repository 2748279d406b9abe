"""Block bootstrap of one recording: replicates, and how often their diagnoses name each cause.

A recording of length T is cut into ⌊T/L⌋ blocks of length L = `BLOCK_S`. A replicate consists of
⌊T/L⌋ blocks, drawn with replacement and sorted by time (Künsch, Annals of Statistics 17, 1989). The
samples within a block are unchanged, so the correlation of the noise over times shorter than L is
preserved. A pause of `PAUSE_S` without samples separates the blocks, so the estimation uses a
separate initial state for each.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from heli3dof.errors import RecordingError
from heli3dof.recording.recording import Recording

BLOCK_S = 5.0
"""Length of a block in s: more than three times the rise time of a reference step, so that a block
contains a whole response. The default controller's rise time is 0.7 to 1.4 s (``heli3dof info``).
Chosen."""
PAUSE_S = 1.0
"""Pause in s between two blocks: longer than the gaps that an estimation bridges. Chosen."""
LEAST_BLOCKS = 6
"""Fewest blocks: with 6, two replicates are equal with a probability of less than 1 %"""
TIME_STAMP_EFFECTS = "timing."
"""Prefix of the effects on the time stamps, such as ``timing.gaps``; the pauses cause them."""


def block_replicate(recording: Recording, replicate: int, seed: int = 0) -> Recording:
    """Return a bootstrap replicate of a recording; for ``replicate`` = 0, the recording itself.

    ``replicate`` (1, 2, …) and ``seed`` determine the random blocks. Raises RecordingError if the
    recording is shorter than `LEAST_BLOCKS` blocks.
    """
    if replicate == 0:
        return recording
    n = round(BLOCK_S / recording.dt)
    blocks = len(recording) // n
    if blocks < LEAST_BLOCKS:
        raise RecordingError(
            f"{recording.name} is too short for a bootstrap: {recording.duration:.0f} s.",
            cause=f"it needs {LEAST_BLOCKS} blocks of {BLOCK_S:g} s.",
            fix="fly a longer plan: heli3dof run rich",
        )
    drawn = np.sort(np.random.default_rng([seed, replicate]).integers(0, blocks, blocks))
    rows = (drawn[:, None] * n + np.arange(n)).ravel()
    clock = recording.t[rows] - np.repeat(recording.t[drawn * n], n)
    start = np.repeat(np.arange(blocks) * (BLOCK_S + PAUSE_S), n)
    return replace(recording.rows(rows), t=start + clock, channels={}, start_s=None)


@dataclass(frozen=True)
class NamedShare:
    """A cause, and how many bootstrap replicates' diagnoses name it: ``named`` out of ``of``.

    An effect that the diagnosis reports as confounded with a cause also counts as named.
    """

    cause: str
    named: int
    of: int
    in_recording: bool
    """True if the diagnosis of the recording itself names the cause"""

    @property
    def share(self) -> float:
        return self.named / self.of

    @property
    def interval(self) -> tuple[float, float]:
        """Return Wilson's 95 % interval of the share of replicates that name the cause."""
        from scipy.stats import binomtest

        low, high = binomtest(self.named, self.of).proportion_ci(0.95, method="wilson")
        return float(low), float(high)

    def to_dict(self) -> dict[str, Any]:
        return {
            "cause": self.cause,
            "share": self.share,
            "interval": list(self.interval),
            "replicates": self.of,
            "in_recording": self.in_recording,
        }


def named_shares(rows: Iterable[Mapping[str, Any]]) -> list[NamedShare]:
    """Return, for each cause, the share of a recording's replicates whose diagnoses name it.

    The largest share is first; the list is empty without replicates. ``rows``: rows of ``batch
    diagnose``; their column ``replicate`` is 0 for the recording itself. Failed replicates do not
    count.
    """
    diagnosed = [row for row in rows if row["exit_code"] == 0]
    replicates = [row for row in diagnosed if row["replicate"]]
    counts = Counter(cause for row in replicates for cause in causes_of(row))
    own = {cause for row in diagnosed if not row["replicate"] for cause in causes_of(row)}
    shares = [NamedShare(c, counts[c], len(replicates), c in own) for c in {*counts, *own}]
    return sorted(shares, key=lambda s: (-s.named, s.cause)) if replicates else []


def causes_of(row: Mapping[str, Any]) -> set[str]:
    """Return the names of the causes in a diagnosis, and of the effects confounded with them.

    ``row``: the diagnosis's row in the results table of ``batch diagnose``. The function leaves out
    effects on the time stamps (``timing.gaps``). A bootstrap replicate has pauses between its
    blocks, and a diagnosis reports these pauses as such effects.

    >>> sorted(causes_of({"causes": "timing.gaps; friction.coulomb.yaw|motor.lag"}))
    ['friction.coulomb.yaw', 'motor.lag']
    """
    groups = (row["causes"] or "").split("; ")
    names = {name for group in groups for name in group.split("|") if name}
    return {n for n in names if not n.startswith(TIME_STAMP_EFFECTS)}
