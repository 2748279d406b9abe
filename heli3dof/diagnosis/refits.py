"""What the estimator makes of a rig one of whose parameters is known: simulated and fitted again.

The standard deviation of an estimate freed of its bias (`heli3dof.diagnosis.corrected`) holds the
noise's intensities fixed. Where encoders chatter in the loop, noise and inertia rise and fall
together along a ridge, and the estimate scatters up to twice as much, a little to one side. How
much, and to which, is seen by doing it all again (a parametric bootstrap): the parameter is pinned
to a value x_0, everything else estimated beside it, that rig is flown B times as the recordings
were, and each flight is estimated with x free,

    δ_b = ln x_b/x_0,      b = 1 … B

An estimate of the recordings themselves as far from x_0 as no δ_b is no rig's that stands at x_0.
Of flights whose estimate does not settle nothing is known; they are left out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from heli3dof.diagnosis.corrected import Corrected, Informed, correct, fly_again, model_at
from heli3dof.diagnosis.steps import Bench, beginning
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.fit import maximise

PILOTS = 6
ROUNDS = 6
FIRM = 1e-4
"""Standard deviation of a pinned coordinate."""


@dataclass(frozen=True, eq=False)
class Pinned(Informed):
    """The likelihood with coordinate ``which`` held at ``at``, by a prior that allows no other."""

    which: int = 0
    at: float = 0.0

    @cached_property
    def prior_mean(self) -> np.ndarray:
        """(n,) coordinates"""
        mean = np.array([f.inward(f.start) for f in self.structure.free])
        mean[self.which] = self.at
        return mean

    @cached_property
    def prior_precision(self) -> np.ndarray:
        """(n,)"""
        precision = np.array(Informed.prior_precision.func(self))  # type: ignore[attr-defined]
        precision[self.which] = 1 / FIRM**2
        return precision


def refits(bench: Bench, found: Corrected, j: int, value: float, *, flights: int) -> np.ndarray:
    """(≤ ``flights``,) δ_b of the base's parameter j where it is ``value`` (in the fit's units)."""
    problem, f = found.problem, found.free[j]
    pinned = Pinned(
        problem.data, problem.structure, problem.noise_steps, which=j, at=f.inward(value)
    )
    theta = found.theta.copy()
    theta[j] = pinned.at
    there = correct(
        pinned, theta, found.optimum.noise, bench.recordings, seed=bench.seed,
        pilots=PILOTS, rounds=ROUNDS,
    )  # fmt: skip
    model = model_at(problem, there.theta, there.optimum.noise)
    out = []
    for b in range(flights):
        data = fly_again(model, bench.recordings, problem.data, (bench.seed, 11, b))
        again = replace(problem, data=data)
        plain = Estimate(again, maximise(again, there.theta, there.optimum.noise))
        free = correct(
            again, *beginning(plain), bench.recordings, seed=bench.seed + 101 + b,
            pilots=PILOTS, rounds=ROUNDS,
        )  # fmt: skip
        if free.optimum.converged:
            out.append(float(np.log(max(free.values[j] / value, 1e-3))))
    return np.array(out)
