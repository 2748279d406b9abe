"""Correct the bias of ``identify``'s fits to closed-loop recordings.

The filter's likelihood assumes Gaussian distributions, but encoders quantise and the controller
feeds the quantised angles back. So the maximum of the likelihood is biased. For example, on the
plan ``steps`` a rotor lag of 20 ms is estimated six standard deviations too short. On 10° steps of
24 rigs, no 95 % interval of the roll or pitch inertia contained the true value (`make bench
TOPIC=greybox`): the encoders were on a limit cycle of a count or two. `without_bias` corrects the
fit by simulated flights of the fitted model (`bias_correction.correction`).

On an extreme limit cycle, even the corrected inertia may be several times too small. Then the
recordings' scores (the log-likelihood's gradients) have a larger variance than those of the
simulated flights. In this case `without_bias` makes a second corrected fit, with the process noise
that a diagnosis would estimate (`closed_loop_fit.base_fit`). It returns the fit for which the ratio
of these two variances is smaller (`unexplained_scatter`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.identification.bias_correction.corrected_maximum import maximise_corrected
from heli3dof.identification.bias_correction.correction import CorrectedFit, correct
from heli3dof.identification.closed_loop_fit.base_fit import fit_base
from heli3dof.identification.closed_loop_fit.limit_cycle import scatters_on_limit_cycle
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.model.control.voltage_replay import controller_is_known, with_known_controller
from heli3dof.recording.recording import Recording

FLIGHTS, ROUNDS = 8, 20
"""Simulated flights per round, and largest number of rounds, of the correction. Chosen: with 8
flights, the standard error of their mean score is 1/√8 of one score's standard deviation."""


def without_bias(found: Estimate, recordings: Sequence[Recording]) -> Estimate:
    """Return the bias-corrected fit, or ``found`` if a correction is not possible.

    ``recordings`` are those that ``found`` was fitted to, in the same order. The correction needs,
    in every recording, a known controller (`model.control.voltage_replay`), all angles and their
    references. If the correction diverges, the result is ``found``, too.
    """
    flown = [with_known_controller(r) for r in recordings]
    if not controller_is_known(flown):
        return found
    fits = [_corrected(found, flown)]
    if scatters_on_limit_cycle(fits[0]):
        setup = Setup(tuple(flown), seed=0, flights_per_round=FLIGHTS)
        fits.append(_corrected(with_noise_of_base(found, setup), flown))
    fits = [f for f in fits if f.is_corrected]
    return min(fits, key=lambda f: f.unexplained_scatter, default=found)


def _corrected(fit: Estimate, recordings: Sequence[Recording]) -> CorrectedFit:
    o = fit.optimum
    start = o.theta, o.noise
    return correct(
        fit.problem, [start], recordings, seed=0, flights_per_round=FLIGHTS, rounds=ROUNDS
    )


def with_noise_of_base(found: Estimate, setup: Setup) -> Estimate:
    """Fit the model of ``found`` again; fix the process noise of axes that are on a limit cycle.

    On these axes, the noise is that of the base simulation (`fit_base`), the model to which a
    diagnosis adds effects. The search starts at the gravity torque and inertias of the base
    simulation, and at the prior means of the other parameters. The bias is not corrected.
    """
    base = fit_base(setup)
    problem = replace(found.problem, known_noise=base.problem.known_noise)
    theta = np.append(base.theta, problem.prior_mean[len(base.theta) :])
    return Estimate(problem, maximise_corrected(problem, theta, base.optimum.noise, None))


def correction_note(found: Estimate) -> list[str]:
    """Return a sentence on the bias correction, in a list; empty for an uncorrected fit."""
    if not isinstance(found, CorrectedFit):
        return []
    return [
        "Encoder quantisation and feedback bias the likelihood; "
        f"{found.flights} simulated flights of the fitted rig corrected this."
    ]
