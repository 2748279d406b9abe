"""Fit the base simulation, the model to which a diagnosis adds effects.

If the controller is known, the fit is bias-corrected (`bias_correction.correction`). ``identify``
takes the process noise of this fit if its own corrected fit does not explain a limit cycle
(`closed_loop_fit.identify_correction`). There are two special cases:

- The recordings have a limit cycle. Then a smaller inertia with more noise has nearly the same
  likelihood as the true values. So the bias correction starts at the noise with which simulated
  flights have the recorded limit cycle (`closed_loop_fit.limit_cycle`). If the correction diverges,
  it is repeated from the maximum of the uncorrected likelihood. After a successful correction, a
  further fit also matches how often the encoder counts change (`closed_loop_fit.edge_rates`).
- An inertia is implausible (`implausible_inertias`). Then the fit is repeated with a narrow prior
  of the inertias (`with_plausible_inertias`). The later fits of a diagnosis follow the same rule.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from heli3dof.axes import AXES
from heli3dof.identification.bias_correction.correction import CorrectedFit, Start, correct
from heli3dof.identification.closed_loop_fit.edge_rates import fit_with_edge_rates
from heli3dof.identification.closed_loop_fit.limit_cycle import matched_noise, on_limit_cycle
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.estimate import Estimate, estimate
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import compile_first
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.effects import terms as named
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.physics.parametrisation import Structure, thrust_per_volt_ratio

MAX_INERTIA_RATIO = 2.5
"""Largest plausible factor between an inertia and its nominal value, up or down. Chosen."""
TIGHT_PRIOR = 0.1
"""The narrow prior's std of an inertia's logarithm, as a multiple of the tolerance. Chosen."""
HELD_STD = 1e-4
"""Prior std of a scaled parameter that keeps its value; far below the std of any estimate"""

BASES: dict[str, tuple[str, ...]] = {"rigid": (), "hover": ("base.hover",)}
"""Name of the base simulation → effects that it adds to the rigid body"""


@dataclass(frozen=True, eq=False)
class LikelihoodWithInertiaPrior(Likelihood):
    """The likelihood of recordings, with a prior that keeps the inertias near the rig's profile.

    The prior standard deviation of an inertia's logarithm is ``std_per_tolerance`` times the
    ``tolerance`` of the profile. With the weaker prior of `Likelihood`, a fit to a short recording
    could give implausible inertias.
    """

    std_per_tolerance: float = 1.0
    """Prior std of an inertia's logarithm, as a multiple of the tolerance"""
    at_nominal: tuple[int, ...] = ()
    """Indices of the parameters that keep the profile's value"""
    inertia_ratio: float = 1.0
    """Ratio of the inertias' prior means to the profile's values"""
    implausible: tuple[str, ...] = ()
    """Axes whose inertia is implausible without the narrow prior: the likelihood is biased there"""

    @cached_property
    def prior_mean(self) -> np.ndarray:
        """Return the prior mean (n,) of the scaled parameters.

        The scaled parameter of an inertia J is ln J. Its prior mean is ln(r J_0), with the
        profile's inertia J_0 and r = ``inertia_ratio``. For an inertia in ``at_nominal``, r is 1.
        """
        mean = super().prior_mean.copy()
        mean[[j for j in (1, 2, 3) if j not in self.at_nominal]] += np.log(self.inertia_ratio)
        return mean

    @cached_property
    def prior_precision(self) -> np.ndarray:
        """Return the prior's precision (n,): 1/variance of each scaled parameter."""
        precision = super().prior_precision.copy()
        precision[1:4] = 1.0 / (self.std_per_tolerance * self.structure.profile.tolerance) ** 2
        precision[list(self.at_nominal)] = 1.0 / HELD_STD**2
        return precision


def fit_base(setup: Setup) -> CorrectedFit:
    """Return the fitted base simulation, to which a diagnosis adds effects.

    Raises RecordingError if no row is usable.
    """
    runs = [run for i, r in enumerate(setup.recordings) for run in usable_runs(r, i)]
    structure = Structure(setup.recordings[0].profile, named(BASES[setup.base]))
    problem = LikelihoodWithInertiaPrior(data_of(setup.recordings, runs), structure)
    compile_first(problem)
    return with_plausible_inertias(problem, lambda p: corrected_base(setup, p))


def with_plausible_inertias(
    problem: Likelihood, fit: Callable[[Likelihood], CorrectedFit]
) -> CorrectedFit:
    """Return ``fit(problem)``, repeated with a narrow prior if an inertia is implausible.

    ``fit`` fits the parameters of a likelihood. The mean of the narrow prior is the profile's
    inertias times `thrust_ratio`. A ``problem`` that is no `LikelihoodWithInertiaPrior` is fitted
    only once.
    """
    if not isinstance(problem, LikelihoodWithInertiaPrior):
        return fit(problem)
    wide = replace(problem, std_per_tolerance=1.0, inertia_ratio=1.0, implausible=())
    result = fit(wide)
    axes = implausible_inertias(result)
    if not axes:
        return result
    ratio = thrust_ratio(result, axes)
    narrow = replace(wide, std_per_tolerance=TIGHT_PRIOR, inertia_ratio=ratio, implausible=axes)
    return fit(narrow)


def thrust_ratio(fit: Estimate, implausible: Sequence[str]) -> float:
    """Return the factor by which a wrong thrust gain multiplies trim torque and inertias in a fit.

    A parameter's ratio is its fitted value divided by the profile's value. The factor is the median
    ratio of the trim torque and of the inertias, except those of the axes ``implausible``. In two
    cases, the trim torque is no evidence of a wrong thrust gain, and the function returns 1:

    - The ratio of the trim torque differs from 1 by at most the profile's ``tolerance``.
    - The trim torque is too large or too small by a factor of more than `MAX_INERTIA_RATIO`. So the
      trim torque itself is implausible.
    """
    profile, (trim, *inertias) = fit.structure.profile, fit.values[:4]
    ratio = trim / profile.trim_torque if profile.trim_torque else 1.0
    is_plausible = 1 / MAX_INERTIA_RATIO < ratio < MAX_INERTIA_RATIO
    if not is_plausible or abs(ratio - 1) <= profile.tolerance:
        return 1.0
    # `thrust_per_volt_ratio` ignores zeros.
    known = [0.0 if a in implausible else J for a, J in zip(AXES, inertias, strict=True)]
    return thrust_per_volt_ratio(profile, [trim, *known])


def implausible_inertias(fit: Estimate) -> tuple[str, ...]:
    """Return the names of the measured axes whose fitted inertia is implausible.

    Such an inertia differs from the nominal one by a factor of more than `MAX_INERTIA_RATIO`. On an
    axis that hardly moves, it may hide a missing effect from the score test. If the ratios of all
    three inertias to nominal are equal within the profile's tolerance, none is implausible. Then
    the thrust gain or the time scale of the recording is wrong, so the nominal inertias are no
    reference.
    """
    log_ratio, axes = fit.theta[1:4] - fit.problem.prior_mean[1:4], fit.problem.data.axes
    apart = np.abs(log_ratio - np.median(log_ratio)).max()
    if axes.all() and apart <= np.log1p(fit.structure.profile.tolerance):
        return ()
    far = axes & (np.abs(log_ratio) > np.log(MAX_INERTIA_RATIO))
    return tuple(axis for axis, is_far in zip(AXES, far, strict=True) if is_far)


def corrected_base(setup: Setup, problem: Likelihood) -> CorrectedFit:
    """Return the fit of the base simulation, the model to which a diagnosis adds effects.

    If the controller is known, the fit is bias-corrected.
    """
    plain = estimate(problem)
    if not setup.controller_is_known:
        return CorrectedFit(problem, plain.optimum)
    cycling = on_limit_cycle(problem.data)
    starts = list[Start]()
    if cycling.any():
        starts = [start_on_limit_cycle(setup, plain, cycling, s) for s in start_scales(plain)]
    starts.append((plain.optimum.theta, plain.optimum.noise))
    fit = correct(
        problem,
        starts,
        setup.recordings,
        seed=setup.seed,
        flights_per_round=setup.flights_per_round,
    )
    if not fit.is_corrected or not cycling.any():
        return fit
    fit = fit_with_edge_rates(problem, fit, setup.recordings, seed=setup.seed)
    # Later fits do not match the edge rates, and would increase the noise again. So it stays fixed.
    return replace(fit, problem=replace(problem, known_noise=tuple(cycling.tolist())))


def start_scales(plain: Estimate) -> list[float]:
    """Return factors on the profile's inertias for the start points of a bias correction.

    They are used for recordings with a limit cycle. The bias correction starts at the inertias with
    the first factor, which is 1. If it diverges, it starts again with the second factor. There is a
    second factor only if the trim torque of the uncorrected fit ``plain`` shows that the thrust
    gain is wrong. It is the factor by which this error multiplies the inertias (`thrust_ratio`).
    """
    ratio = thrust_ratio(plain, AXES)
    return [1.0] if ratio == 1.0 else [1.0, ratio]


def start_on_limit_cycle(setup: Setup, plain: Estimate, cycling: np.ndarray, scale: float) -> Start:
    """Return start values for the bias correction of a fit to recordings with a limit cycle.

    They are n scaled parameters and the noise (4,). The parameters are those of the fit ``plain``,
    but the inertias are the profile's times ``scale``. With the noise from `matched_noise`,
    simulated flights have the recorded limit cycle. ``cycling`` (3,) bool: axes on a limit cycle.
    """
    theta, noise = plain.theta.copy(), plain.optimum.noise
    theta[1:4] = plain.problem.prior_mean[1:4] + np.log(scale)
    return theta, matched_noise(
        plain.problem, theta, noise, cycling, setup.recordings, seed=setup.seed
    )
