"""``multisine``: sums of cosines on the common voltage and the difference.

    c(t) = A_c Σ_odd  f_k^−tilt cos(2π f_k t + φ_k) / σ_c,     V_front += c + d
    d(t) = A_d Σ_even f_k^−tilt cos(2π f_k t + φ_k) / σ_d,     V_back  += c − d

f_k = k/duration_s, within ``band_Hz``; with ``tilt`` > 0 the amplitudes fall with frequency. σ_c
and σ_d are the RMS of the sums, so A_c = ``common_V`` and A_d = ``difference_V`` are RMS voltages.
Common and difference voltage contain alternate frequencies, so they are orthogonal over the
segment. Roll responds to the common voltage, pitch to the difference. Of `DRAWS` random sets of
phases φ_k the segment uses the set with the lowest crest factor (peak/RMS).
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np

from heli3dof.experiment.segments import Band, BaseSegment, Clock
from heli3dof.toml_file import Finite, Key

DRAWS = 32
"""Random sets of phases φ_k; more of them lower the crest factor little"""


class Segment(BaseSegment):
    kind: Literal["multisine"] = "multisine"
    band_Hz: Band = (0.05, 5.0)
    common_V: Annotated[Finite, Key("RMS on both motors alike", "V")] = 0.5
    difference_V: Annotated[Finite, Key("RMS on front, opposite on back", "V")] = 0.5
    tilt: Annotated[Finite, Key("amplitudes fall as 1/frequency to this power", "–")] = 0.0

    def render(self, clock: Clock, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        f0 = 1 / (clock.n * clock.dt)
        first = max(1, int(np.ceil(self.band_Hz[0] / f0)))
        last = max(first + 1, int(min(self.band_Hz[1], 0.4 / clock.dt) / f0))
        lines = np.arange(first, last + 1)
        c = self.common_V * _low_crest(lines[0::2], self.tilt, clock)
        d = self.difference_V * _low_crest(lines[1::2], self.tilt, clock)
        reference, _ = super().render(clock, before)
        return reference, np.column_stack([c + d, c - d])

    def details(self) -> str:
        return (
            f"{self.common_V:g} V common and {self.difference_V:g} V "
            f"difference, {self.band_Hz[0]:g}–{self.band_Hz[1]:g} Hz"
        )


def _low_crest(lines: np.ndarray, tilt: float, clock: Clock) -> np.ndarray:
    """Return a multisine (n,) of RMS 1 with a low crest factor.

    Of `DRAWS` signals with random phases it is the one with the smallest peak, shifted cyclically
    so that it starts near zero. ``clock`` gives the number n of control periods and their length dt
    in s. ``lines``: the signal's frequencies in multiples of 1/(n dt). The amplitudes are
    proportional to frequency^−tilt.
    """
    best, best_peak = np.zeros(clock.n), np.inf
    amplitude = lines.astype(float) ** -tilt
    for _ in range(DRAWS):
        phase = clock.rng.uniform(0, 2 * np.pi, len(lines))
        spectrum = np.zeros(clock.n // 2 + 1, dtype=complex)
        spectrum[lines] = amplitude * np.exp(1j * phase)
        x = np.fft.irfft(spectrum, clock.n)
        x /= np.sqrt(np.mean(x**2))
        peak = float(np.abs(x).max())
        if peak < best_peak:
            # A periodic signal may start anywhere: at its quietest sample the motors do not jump.
            best, best_peak = np.roll(x, -int(np.argmin(np.abs(x)))), peak
    return best
