"""The base simulation's fit, with which a diagnosis begins: freed of its bias, off the ridges.

Three things lead it astray. Where encoders chatter, the filter's likelihood is biased and its
scores hardly tell less inertia under more noise from the rig that flew: then it begins at the quiet
end (`beginning`) and is weighed with the encoders' rates (`heli3dof.diagnosis.weighed`). And what a
flight hardly tips may run away to an inertia that no rig has (`runaway`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.corrected import NOISE_NEAR, Corrected, Informed, correct
from heli3dof.diagnosis.steps import Bench, without
from heli3dof.diagnosis.tilted import maximise_tilted
from heli3dof.diagnosis.weighed import weighed
from heli3dof.identification.greybox.estimate import Estimate, estimate
from heli3dof.identification.greybox.maximum_likelihood import better_noise
from heli3dof.identification.greybox.method import compile_first, usable_runs
from heli3dof.model.effects import terms as named
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.physics.parametrisation import Structure

UNHEARD_OF = 2.5
"""An inertia's ratio to nominal, or its inverse"""
HELD_BY = 0.1
"""Of the tolerance, to which the inertias are held until a cause is found where they ran away"""
CHATTERS = 1.2
"""Inflation of a fit from which its bias is too large to start from."""
QUIETER = np.array([0.5, 0.7, 1.0, 1.0])
"""What the filter makes of a chattering flight's noise, roughly; roll and pitch chatter most."""
VAGUE = 0.4
"""Of the profile's tolerance: how uncertain an inertia is, by the noise model, where chatter's part
in it matters."""

BASES: dict[str, tuple[str, ...]] = {"rigid": (), "hover": ("base.hover",)}
"""What each base simulation is made of beside the rigid body."""


def base_of(bench: Bench) -> Corrected:
    """The base simulation, fitted. Raises RecordingError where there is nothing to fit."""
    runs = [run for i, r in enumerate(bench.recordings) for run in usable_runs(r, i)]
    structure = Structure(bench.recordings[0].profile, named(BASES[bench.base]))
    problem = Informed(data_of(bench.recordings, runs), structure)
    compile_first(problem)
    found = base_at(bench, problem)
    return base_at(bench, replace(problem, doubt=HELD_BY)) if runaway(found) else found


def as_written(base: Corrected, found: Corrected) -> Corrected:
    """The base simulation with its body's equations written as ``found`` has them: refitted."""
    if not found.structure.formal:
        return base
    own = {t.name for t in base.structure.terms}
    for t in found.structure.terms:
        if t.name not in own and not t.effect.formal:
            found = without(found, t)
    return found


def runaway(found: Estimate) -> bool:
    """Whether an inertia is one that no rig has.

    What a rig that hardly tips lacks (a constant torque of a volt of trim, above all) is hidden as
    well by a body too heavy to answer, and noise: nothing would be seen beside these.
    """
    apart = found.theta[1:4] - found.problem.prior_mean[1:4]
    return bool(np.abs(apart[found.problem.data.axes]).max(initial=0.0) > np.log(UNHEARD_OF))


def base_at(bench: Bench, problem: Informed) -> Corrected:
    """The base's numbers as that problem has them, freed of their bias where the loop is known."""
    found = estimate(problem)
    if not bench.controller_is_known:
        return Corrected(problem, found.optimum)
    freed = correct(
        problem, *beginning(found), bench.recordings, seed=bench.seed, pilots=bench.pilots
    )
    if freed.scatter is None:
        return Corrected(problem, found.optimum)
    if (
        found.inflation < CHATTERS
        or told_of_inertias(freed) < VAGUE * problem.structure.profile.tolerance
    ):
        return freed
    return weighed(problem, freed, bench.recordings, seed=bench.seed)


def told_of_inertias(found: Estimate) -> float:
    """The largest standard deviation of their logarithms, by the noise model."""
    A = found.optimum.information + np.diag(found.problem.prior_precision)
    return float(np.sqrt(np.diag(np.linalg.inv(A))[1:4].max()))


def beginning(found: Estimate) -> tuple[np.ndarray, np.ndarray]:
    """Where to start correcting from: a fit; one at less noise where the encoders chatter.

    Where they do, noise and inertia rise and fall together along a ridge of the filter's
    likelihood, and the solution is reached from its quiet end only.
    """
    problem, o = found.problem, found.optimum
    if found.inflation < CHATTERS:
        return o.theta.copy(), o.noise.copy()
    theta, noise = o.theta.copy(), o.noise.copy()
    theta[1:4] = problem.prior_mean[1:4]
    for _ in range(5):
        noise, moved = better_noise(problem, theta, noise, problem.data.axes)
        if moved < NOISE_NEAR:
            break
    quiet = noise * QUIETER
    at = maximise_tilted(problem, theta, quiet, None, rounds=6, hold_noise=True)
    return at.theta, quiet
