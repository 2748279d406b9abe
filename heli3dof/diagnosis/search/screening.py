"""Screen a fit: standardised scores Z of all candidates, and the effects that can be detected.

Z = (z − mean z_null) / std z_null. z are the recordings' scores (`search.score_test`), z_null the
scores of flights simulated from the fit (`search.nulls`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from heli3dof.diagnosis.constants import LARGE, SIGMAS_997
from heli3dof.diagnosis.search.catalogue import Probe
from heli3dof.diagnosis.search.nulls import Nulls
from heli3dof.diagnosis.search.score_test import Screen, ScreenResult
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.model.effects import Term

ONE_SIDED = 0.25
"""A parameter is one-sided if its range below the null value, divided by its range above it, is
less than this. Chosen."""


@dataclass(frozen=True, eq=False)
class Screening:
    """A fit's score test: the recordings' scores, and their distribution in null simulations."""

    fit: CorrectedFit
    """The current fit: the base with all causes of earlier steps"""
    screen: Screen
    recorded: ScreenResult
    """Scores of the recordings"""
    nulls: Nulls
    bias: np.ndarray
    """(n,) mean of ∂ℓ/∂θ over the null simulations; ℓ: log-likelihood, θ: parameters of ``fit``"""

    @cached_property
    def Z(self) -> np.ndarray:
        """Return the score-test statistics Z (P,) of P candidate effects, from the recordings.

        They are standardised: without any effect, their mean is zero and their variance about one.
        Each effect is tested with given values of its parameters.
        """
        return self.nulls.standardised(self.recorded)

    @cached_property
    def ranked(self) -> list[tuple[Term, float, int]]:
        """Return (term, Z², index of the trial values with this Z²) of each term, by falling Z².

        A term may be tested with several trial values of its parameters. Its Z² is the largest one
        of these tests. Z² counts as zero if the estimated effect has the wrong sign, such as a
        negative friction.
        """
        best: dict[str, tuple[Term, float, int]] = {}
        for i, p in enumerate(self.recorded.probes):
            Z2 = float(self.Z[i]) ** 2 if self.Z[i] > 0 or not one_sided(p) else 0.0
            if p.name not in best or best[p.name][1] < Z2:
                best[p.name] = (p.term, Z2, i)
        return sorted(best.values(), key=lambda b: -b[1])

    @property
    def largest(self) -> list[tuple[str, float]]:
        """Return the three terms with the largest Z², each with its Z²."""
        return [(t.name, z) for t, z, _ in self.ranked[:3]]

    @cached_property
    def not_identifiable(self) -> tuple[str, ...]:
        """Return the names of the terms whose size the recordings do not determine.

        The size is the term's first parameter. Let σ be the standard deviation of the size, and s
        its typical value. The result contains the terms with `SIGMAS_997` σ > `LARGE` s. The term
        with the smallest σ/s is first. A voltage limit is included if the recorded voltages never
        reach it.
        """
        best: dict[str, float] = {}
        for p, s, v in zip(self.screen.plain, self._size_std, self.screen.v, strict=True):
            share = SIGMAS_997 * float(s) / (LARGE * p.term.effect.parameters[0].typical)
            if p.size is None:  # a limit is identifiable if the recordings reach it
                share = 0.0 if np.isfinite(v) else np.inf
            best[p.name] = min(best.get(p.name, np.inf), share)
        return tuple(sorted((n for n, share in best.items() if share > 1), key=lambda n: best[n]))

    def detectable_size(self, name: str) -> float:
        """Return the size of a term's first parameter, in its unit, at which Z² is significant.

        The size is infinite for a term without fixed trial values, such as a torque that is tested
        at every frequency.
        """
        plain = zip(self.screen.plain, self._size_std, strict=True)
        named = [float(s) for p, s in plain if p.name == name]
        return float(np.sqrt(self.nulls.threshold)) * min(named, default=np.inf)

    @cached_property
    def _size_std(self) -> np.ndarray:
        """Return the standard deviation of an effect's size, for each element of ``screen.plain``.

        An element of ``screen.plain`` is an effect with trial values of its parameters. The size is
        the effect's first parameter, in its unit; the score test estimates it. The standard
        deviation is practically infinite if the recordings contain no information on the size. This
        also applies to a voltage limit, which has no size.
        """
        plain, v = self.screen.plain, self.screen.v
        size = np.array([np.inf if p.size is None else p.size for p in plain])
        information = np.maximum(np.where(np.isfinite(v), v, 0.0) / size**2, 1e-300)
        return np.asarray(self.nulls.std[: len(plain)] / np.sqrt(information))


def one_sided(probe: Probe) -> bool:
    """Return True if a rig can have the effect with one sign only, such as friction."""
    if probe.term.effect.scan or probe.size is None:
        return True
    q = probe.term.effect.parameters[0]
    return q.null - q.low < ONE_SIDED * (q.high - q.null)
