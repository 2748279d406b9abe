"""Measure which share of a recording's voltages a controller's law does not explain.

The law's errors are the logged voltages minus those of the law. A share is the size of these
errors, divided by the standard deviation of a reference signal. The caller chooses how to measure
the size, for example as RMS, and which voltage signal is the reference. The share is computed for
each motor in blocks of `BLOCK_S` seconds. The block's share is the larger of the two motors'
shares. The recording's share is the upper quartile of its blocks' shares, because a landing, a lost
sample or a voltage limit makes single blocks differ.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

BLOCK_S = 2.0
"""s, length of a block. Chosen: a flight has several, and a landing fills one or two."""
LEAST_ROWS = 20
"""Fewest rows of a block. Chosen."""
LEAST_BLOCKS = 3
"""Fewest blocks of a recording. Chosen."""
AT_LIMIT = 0.98
"""Share of v_max from which a voltage counts as limited. Chosen."""


def is_limited(voltage: np.ndarray, v_max: float) -> np.ndarray:
    """Return (N,) bool: rows in which a motor is at its voltage limit, or off (exactly 0 V).

    ``voltage`` (N, 2) V are the voltages of both motors, ``v_max`` (V) is the limit. Such rows are
    no data on the control law, because the limit or the switch-off has replaced its voltage.

    >>> is_limited(np.array([[6.0, 7.0], [6.0, 10.0], [0.0, 7.0]]), v_max=10.0).tolist()
    [False, True, True]
    """
    return np.asarray(((np.abs(voltage) >= AT_LIMIT * v_max) | (voltage == 0)).any(axis=1))


def unexplained_share(
    t: np.ndarray,
    e: np.ndarray,
    signal: np.ndarray,
    size: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> float | None:
    """Return how large the errors ``e`` of a control law are, relative to a voltage ``signal``.

    The function divides the recording into blocks of `BLOCK_S` seconds. In each block it computes
    the ratio size(t, e)/std(signal) for each motor, and uses the larger of the two. The result is
    the upper quartile of the blocks' ratios.

    ``t`` (N,): s since the start of the first block. ``e``, ``signal`` (N, 2): errors and signal of
    both motors, V. ``size``: function that returns the size (2,) of one block's errors, such as
    their standard deviation. Blocks with too few rows, or in which a motor's signal is constant,
    are left out. Returns None if fewer than `LEAST_BLOCKS` blocks remain.

    >>> t, e = np.arange(300) * 0.02, np.full((300, 2), 0.5)
    >>> signal = np.where(np.arange(300) % 2, 1.0, -1.0)[:, None] * [1.0, 2.0]  # std 1 and 2
    >>> unexplained_share(t, e, signal, lambda t, e: np.abs(e).max(axis=0))
    0.5
    """
    shares = []
    for own in np.split(np.arange(len(t)), np.flatnonzero(np.diff(t // BLOCK_S)) + 1):
        scale = signal[own].std(axis=0) if len(own) >= LEAST_ROWS else np.zeros(2)
        if (scale > 0).all():
            shares.append(float((size(t[own], e[own]) / scale).max()))
    return float(np.quantile(shares, 0.75)) if len(shares) >= LEAST_BLOCKS else None
