"""Confirm causes by predictions if the controller is unknown.

The controller feeds the encoders' rounding back, which biases the likelihood. Flights simulated
with the controller show this bias (`search.nulls`). If the controller is unknown, no flights can be
simulated. A cause must then also meet this condition on at least one axis i:

    ΔRMSE_i > Δ_i/√12,   and the 95 % interval of ΔRMSE_i lies above zero

ΔRMSE_i (°) is the decrease of the RMSE of predictions 1 s ahead (`validation.gain`), Δ_i (°) the
encoder step, and Δ_i/√12 the standard deviation of rounding. A base parameter off nominal must meet
the same condition. ΔRMSE_i is then the decrease by fitting the parameter instead of keeping the
profile's value.

On an encoder limit cycle the bias may be so large that an axis' inertia is implausible
(`closed_loop_fit.base_fit.with_plausible_inertias`). Then:

- No finding that acts on this axis is reported (`is_biased`).
- Other findings must meet the condition on an axis whose inertia is plausible.
- There are two exceptions, for which any axis suffices. The first is the trim torque: the mean
  voltage determines it, even if an inertia is biased. The second is an effect that only selects a
  form of the rigid body's equations (`Effect.of_base`, `conclusion.adoption`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.base_parameters import PARAMETERS, THRUST_GAIN, OffNominal
from heli3dof.diagnosis.validation.cross_validation import held_out
from heli3dof.diagnosis.validation.gain import Gain, HeldOut, gain
from heli3dof.identification.bias_correction.corrected_maximum import maximise_corrected
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.closed_loop_fit.base_fit import LikelihoodWithInertiaPrior
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile

TRIM = "mass.imbalance"
"""The finding of the trim torque"""


def is_biased(fit: CorrectedFit, axis: str | None) -> bool:
    """Return whether the fit's inertia of the ``axis`` is implausible; False without an axis."""
    return isinstance(fit.problem, LikelihoodWithInertiaPrior) and axis in fit.problem.implausible


def exceeds_rounding(
    g: Gain, profile: Profile, *, axes: Sequence[str] = AXES, increases: bool = False
) -> bool:
    """Return whether the RMSE of one of ``axes`` decreases significantly, by more than rounding.

    Rounding has the standard deviation `rounding_deg`. With ``increases``, the function returns
    whether an RMSE increases significantly, by more than rounding.
    """
    rounding, sign = dict(zip(AXES, rounding_deg(profile), strict=True)), -1 if increases else 1
    changes = {a: g.rmse_deg[a] for a in axes}
    return any(
        x is not None and min(sign * x.low, sign * x.high) > 0 and sign * x.value > rounding[a]
        for a, x in changes.items()
    )


def unbiased_axes(fit: CorrectedFit) -> list[str]:
    """Return the axes whose inertia is plausible in the fit."""
    return [a for a in AXES if not is_biased(fit, a)]


def rounding_deg(profile: Profile) -> np.ndarray:
    """Return the standard deviation (3,) of rounding to encoder counts by axis, in degrees.

    >>> from heli3dof.rig.profile import default_profile
    >>> rounding_deg(default_profile()).round(4).tolist()  # yaw: 360°/8192/√12
    [0.0254, 0.0254, 0.0127]
    """
    return np.asarray(np.degrees(np.abs(profile.encoder.rad_per_count)) / np.sqrt(12))


def confirmed(
    parameters: Sequence[OffNominal], fit: CorrectedFit, after: HeldOut,
    holdout: Sequence[Recording], *, seed: int,
) -> tuple[OffNominal, ...]:  # fmt: skip
    """Return those ``parameters`` whose deviation from nominal improves held-out predictions.

    Each of the ``parameters`` differs from nominal: thrust gain, trim torque or an inertia. To test
    one of them, two models predict the held-out data:

    1. In the first model, ``fit``, all parameters have their fitted values. ``after`` contains the
       results of this model.
    2. In the second model, the tested parameter has the profile's value. The other parameters are
       refitted.

    The deviation is confirmed if the first model has the smaller RMSE on an axis. The difference
    must be significant, and larger than the encoder's rounding.

    The thrust gain is an exception, because no fit estimates it: a wrong thrust gain changes the
    fitted trim torque and inertias by one factor. To test the thrust gain, the second model has the
    profile's trim torque and inertias. Only the other parameters are refitted.
    """

    def gained(p: OffNominal) -> Gain:
        assert isinstance(fit.problem, LikelihoodWithInertiaPrior)
        held = [i for i, name in enumerate(PARAMETERS) if p.term.name in (name, THRUST_GAIN)]
        problem = replace(fit.problem, at_nominal=tuple(held))
        start = fit.optimum.theta.copy()
        start[held] = problem.prior_mean[held]
        optimum = maximise_corrected(problem, start, fit.optimum.noise, None)
        return gain(held_out(CorrectedFit(problem, optimum), holdout), after, seed=seed)

    profile = fit.structure.profile

    def is_confirmed(p: OffNominal) -> bool:
        # The mean voltage determines the trim torque, whatever the bias of an inertia.
        axes = AXES if p.term.name == TRIM else unbiased_axes(fit)
        return not is_biased(fit, p.term.axis) and exceeds_rounding(gained(p), profile, axes=axes)

    return tuple(filter(is_confirmed, parameters))
