"""Simulated nulls: the fitted base flown as the recording was, and what the screen says of that.

B flights of the fitted rig (`heli3dof.diagnosis.noisy_flight`) are screened like the recording.
Each probe's z is then judged by its own nulls,

    Z = (z − mean z_null) / max(std z_null, 1)

so a cause that quantisation and feedback fake is not believed for what they fake. The largest Z²
over the probes of each null follows an extreme-value law; its Gumbel fit (by moments)

    P(max Z² ≤ x) = exp(−exp(−(x − μ)/β)),    β = √6 σ/π,   μ = mean − 0.5772 β

gives the threshold at `FALSE_ALARMS`, and how sure a finding is. Where the scores scatter κ > 2
times as much as the noise model allows (steps alone, whose encoders chatter), the fitted base is
biased and so are flights of it: Z is divided by √κ as well. Where the loop is unknown no
flight can be simulated: z is divided by the root of the inflation and the threshold is Bonferroni's
over the probes, at twice its value.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from heli3dof.diagnosis.catalogue import Probe
from heli3dof.diagnosis.noisy_flight import noisy_flight
from heli3dof.diagnosis.screen import screen
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.method import model_of
from heli3dof.model.filtering import data_of
from heli3dof.recording.recording import Recording

FALSE_ALARMS = 0.003
"""Of the nulls: the share that may exceed the threshold (extrapolated by the Gumbel law)."""
DISTRUSTED = 2.0
"""Inflation of the base fit above which its own flights are no measure of it."""
EULER = 0.5772156649


@dataclass(frozen=True, eq=False)
class Nulls:
    """What the screen says where nothing is hidden: P probes, B flights (none: by formula)."""

    mean: np.ndarray
    std: np.ndarray
    """(P,), (P,)"""
    threshold: float
    """Of the largest Z²"""
    location: float
    scale: float
    """Of the Gumbel law"""
    flights: int
    method: str
    largest: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """(B,) of each null"""

    def judged(self, z: np.ndarray) -> np.ndarray:
        """(P,) Z from z."""
        return np.asarray((z - self.mean) / self.std)

    def confidence(self, Z2: float) -> float:
        """One less the chance that nothing gives as much."""
        return float(np.exp(-np.exp(-(Z2 - self.location) / self.scale)))


def simulated_nulls(
    found: Estimate,
    recordings: Sequence[Recording],
    probes: Sequence[Probe],
    *,
    flights: int,
    seed: int,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> Nulls:
    """Nulls of recordings whose loop is known; `formula_nulls` where one is not."""
    runs = found.problem.data.runs
    last = [max((r.stop for r in runs if r.source == i), default=0) for i in range(len(recordings))]
    model = model_of(found, recordings, "null")
    z = []
    for b in range(flights):
        rng = np.random.default_rng([seed, b])
        flown = [
            noisy_flight(model, r, rng, rows=n) if n else r
            for r, n in zip(recordings, last, strict=True)
        ]
        z.append(screen(found, probes, data_of(flown, runs)).z)
        progress(b + 1, flights)
    Z = np.array(z)
    mean, std = Z.mean(axis=0), np.maximum(Z.std(axis=0, ddof=1), 1.0)
    distrust = float(np.sqrt(found.inflation)) if found.inflation > DISTRUSTED else 1.0
    # Each null against the others, as the recording is against all.
    rest = (Z.sum(axis=0) - Z) / (flights - 1)
    largest = (((Z - rest) / std) ** 2).max(axis=1)
    beta = float(np.sqrt(6) * largest.std(ddof=1) / np.pi)
    mu = float(largest.mean() - EULER * beta)
    threshold = mu - beta * float(np.log(-np.log(1 - FALSE_ALARMS)))
    return Nulls(mean, std * distrust, threshold, mu, beta, flights, "simulated", largest)


def formula_nulls(found: Estimate, probes: Sequence[Probe]) -> Nulls:
    """Without a loop to replay: Bonferroni over the probes, doubled; see the module."""
    from scipy.stats import chi2

    n = len(probes)
    root = float(np.sqrt(max(found.inflation, 1.0)))
    return Nulls(
        np.zeros(n), np.full(n, root), 2 * float(chi2.isf(FALSE_ALARMS / n, 1)),
        4 * float(np.log(n)), 4.0, 0, "Bonferroni over the probes, doubled: the loop is unknown",
    )  # fmt: skip


def loop_is_known(recordings: Sequence[Recording]) -> bool:
    """True where every recording can be flown again."""
    return all(
        r.profile.loop_is_known and len(r.axes) == 3 and any(r.has_reference(a) for a in r.axes)
        for r in recordings
    )
