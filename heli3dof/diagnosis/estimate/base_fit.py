"""The base simulation's fit, with which a diagnosis begins: freed of its bias, off the ridges.

Two things mislead the fit. On a limit cycle the filter's likelihood is biased, and its scores
hardly separate less inertia with more noise from the true rig. Then the fit starts at a noise whose
simulated flights have the recording's limit cycle (`estimate.limit_cycle`), and the edge
rates serve as further moments (`estimate.edge_rates`). And the inertia of an axis that moves
little may become one that no rig has (`inertia_is_implausible`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit, ProfileLikelihood, correct
from heli3dof.diagnosis.estimate.edge_rates import fit_with_edge_rates
from heli3dof.diagnosis.estimate.limit_cycle import matched_noise, on_limit_cycle
from heli3dof.diagnosis.estimate.setup import Setup
from heli3dof.identification.greybox.estimate import Estimate, estimate
from heli3dof.identification.greybox.method import compile_first, usable_runs
from heli3dof.model.effects import terms as named
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.physics.parametrisation import Structure

UNHEARD_OF = 2.5
"""An inertia's ratio to nominal, or its inverse"""
HELD_BY = 0.1
"""Of the tolerance, to which the inertias are held until a cause is found where they ran away"""

BASES: dict[str, tuple[str, ...]] = {"rigid": (), "hover": ("base.hover",)}
"""What each base simulation is made of beside the rigid body."""


def fit_base(bench: Setup) -> CorrectedFit:
    """The base simulation, fitted. Raises RecordingError where there is nothing to fit."""
    runs = [run for i, r in enumerate(bench.recordings) for run in usable_runs(r, i)]
    structure = Structure(bench.recordings[0].profile, named(BASES[bench.base]))
    problem = ProfileLikelihood(data_of(bench.recordings, runs), structure)
    compile_first(problem)
    found = corrected_base(bench, problem)
    return (
        corrected_base(bench, replace(problem, doubt=HELD_BY))
        if inertia_is_implausible(found)
        else found
    )


def inertia_is_implausible(found: Estimate) -> bool:
    """Whether an inertia is one that no rig has.

    What a rig that hardly tips lacks (a constant torque of a volt of trim, above all) is hidden as
    well by a body too heavy to answer, and noise: nothing would be seen beside these.
    """
    apart = found.theta[1:4] - found.problem.prior_mean[1:4]
    return bool(np.abs(apart[found.problem.data.axes]).max(initial=0.0) > np.log(UNHEARD_OF))


def corrected_base(bench: Setup, problem: ProfileLikelihood) -> CorrectedFit:
    """Return the fit of the base's parameters, bias-corrected where the controller is known."""
    found = estimate(problem)
    if not bench.controller_is_known:
        return CorrectedFit(problem, found.optimum)
    theta, noise = found.optimum.theta, found.optimum.noise
    cycling = on_limit_cycle(problem.data)
    if cycling.any():
        theta = theta.copy()
        theta[1:4] = problem.prior_mean[1:4]
        noise = matched_noise(problem, theta, noise, cycling, bench.recordings, seed=bench.seed)
    freed = correct(problem, theta, noise, bench.recordings, seed=bench.seed, pilots=bench.pilots)
    if freed.scatter is None:
        return CorrectedFit(problem, found.optimum)
    if not cycling.any():
        return freed
    found = fit_with_edge_rates(problem, freed, bench.recordings, seed=bench.seed)
    # Along the likelihood's ridge a further effect would be fitted to another rig's noise.
    roll, pitch, yaw = (bool(axis) for axis in cycling)
    return replace(found, problem=replace(problem, known_noise=(roll, pitch, yaw)))
