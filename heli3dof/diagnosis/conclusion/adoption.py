"""Adopt the causes that improve the prediction of held-out data, and drop the others.

The method is backward elimination. For each cause, the model is refitted without this cause. The
gain Δℓ of the cause is the log-likelihood of held-out data in the model with the cause, minus that
in the model without it (`validation.gain`). The cause also has a score: its gain in BIC on the
fitted recordings (`search.select`). A cause is adopted if one of these conditions holds:

1. The 95 % interval of Δℓ lies above zero.
2. Δℓ > `MIN_GAIN`. In addition, the search found this cause before the other causes in the model,
   or the score of the cause is at least `SUFFICIENT`.
3. Δℓ > `LARGE_GAIN`, and the prediction error of an axis decreases significantly.

In short flights, the interval of Δℓ is wide. Condition 2 is for these flights. It trusts the cause
that the search found first, because this cause has passed the score test. A later cause with a
score below `SUFFICIENT` may only compensate for the model error of the first one. The interval of
Δℓ is also wide for effects that act only briefly, such as a dead zone. Condition 3 is for these
effects.

Even if a condition holds, a cause is dropped for any of these reasons:

- It worsens the predictions: the RMSE of at least one axis increases, and the RMSE of no axis
  decreases. An RMSE counts as changed only if the change is significant and larger than the
  encoder's rounding (`worsens`).
- Coloured noise explains it (`is_coloured_noise`).
- An encoder error of at most one count explains the data equally well (`within_a_count`).

If no flights could be simulated, the likelihood may be biased (`conclusion.unknown_controller`). A
cause must then also meet two requirements:

- Inertia: if the cause acts on one axis, the fit gives this axis a plausible inertia. Effects that
  only select a form of the rigid body's equations (`Effect.of_base`) need not meet this
  requirement.
- Predictions: on an axis with a plausible inertia, the RMSE decreases significantly, by more than
  the encoder's rounding. For the effects just mentioned, any axis suffices. Encoder backlash need
  not meet this requirement, because predictions hardly show backlash.

Causes are dropped one at a time: first those that coloured noise or an encoder error explains, then
the one with the smallest Δℓ. After each removal, the Δℓ of the remaining causes are computed again.
Adopted causes are not reported as confounded with each other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.base_parameters import base_parameters, effect_size, in_SI
from heli3dof.diagnosis.conclusion.step_in_noise import step_margin
from heli3dof.diagnosis.conclusion.unknown_controller import (
    exceeds_rounding,
    is_biased,
    unbiased_axes,
)
from heli3dof.diagnosis.constants import SUFFICIENT, TIE
from heli3dof.diagnosis.result import (
    COLOURED,
    DOES_NOT_PAY,
    LIMIT_CYCLE,
    WITHIN_A_COUNT,
    WITHIN_ROUNDING,
    Dropped,
    Finding,
    Fitted,
)
from heli3dof.diagnosis.search.select import Choice, certainty
from heli3dof.diagnosis.search.steps import without
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.cross_validation import held_out
from heli3dof.diagnosis.validation.gain import Gain, HeldOut, gain, gain_interval_positive
from heli3dof.diagnosis.validation.simulation_error import simulation_error
from heli3dof.distributions import normal_cdf
from heli3dof.identification.bias_correction.correction import CorrectedFit, model_at
from heli3dof.identification.greybox.method import model_of
from heli3dof.identification.greybox.thrust_scale import ThrustScale, thrust_scale
from heli3dof.model.greybox.model import nominal
from heli3dof.model.physics.parametrisation import first_parameters
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile

OFFSET, BACKLASH = "encoder.offset", "encoder.backlash"
MIN_GAIN = TIE / 2
"""Least gain in log-likelihood in condition 2: a likelihood ratio of e³ = 20. Chosen."""
LARGE_GAIN = 12.0
"""Least gain in log-likelihood in condition 3. With an exact likelihood and without the effect, the
mean of exp Δℓ on held-out data is at most 1, so Δℓ > 12 has a probability below e⁻¹² (Markov's
inequality). If the variance of the scores is κ times that of an exact likelihood, this probability
is at most 1 − Φ(√(2 · 12/κ)): 3·10⁻⁴ for κ = 2. A phase or instant that is estimated on the
held-out data multiplies the mean by about √(2π) z, z the torque's size in standard deviations."""


@dataclass(frozen=True, eq=False)
class AdoptionResult:
    """The adopted causes with their fit, and the residual torques found in it."""

    fit: CorrectedFit
    findings: tuple[Finding, ...]
    dropped: tuple[Dropped, ...]
    after: HeldOut
    """Results of ``fit`` on held-out data"""
    residual_torques: tuple[ResidualTorque, ...] = ()
    slow_noise: tuple[ResidualTorque, ...] = ()
    """Torques that depend on time only"""
    is_decided: bool = True
    """False if neither causes nor base parameters are certain"""

    @property
    def choices(self) -> tuple[Choice, ...]:
        """Return the steps of the search that found the adopted causes."""
        return tuple(f.choice for f in self.findings)

    @property
    def modelled_torques(self) -> tuple[ResidualTorque, ...]:
        """Return those `residual_torques` that the fit already contains as an additional term."""
        return tuple(t for t in self.residual_torques if t.term is not None)

    def with_causes_of(self, other: AdoptionResult) -> AdoptionResult:
        """Return ``other``, but with the residual torques and the slow noise of ``self``.

        Slow noise is a torque that depends on time only. ``other`` is the result of a later search.
        Its adopted causes and its fit remain unchanged. Its list ``dropped`` is extended by the
        causes that ``self`` dropped, with these exceptions:

        - ``other`` contains the cause in its own list ``dropped``.
        - In a search step, the cause was a candidate, but the step chose one of the adopted causes
          of ``other`` instead.
        """
        decided = {c.term.name for choice in other.choices for c in choice.candidates}
        decided |= {d.name for d in other.dropped}
        return replace(
            other,
            dropped=(*(d for d in self.dropped if d.name not in decided), *other.dropped),
            residual_torques=self.residual_torques,
            slow_noise=self.slow_noise,
        )


def adopted(
    fit: CorrectedFit, choices: Sequence[Choice], holdout: Sequence[Recording], *, seed: int
) -> AdoptionResult:
    """Test the selected causes ``choices``: return the adopted ones, and why others are dropped.

    ``fit`` contains all these causes. ``holdout``: held-out recordings, on which the gain of each
    cause is measured. Without them, the gains are cross-validated.
    """
    kept, dropped = list(choices), list[Dropped]()
    while True:
        reduced = parallel_map(lambda i, f=fit: without(f, kept[i].term.name), len(kept))  # type: ignore[misc]
        after, *befores = each_held_out((fit, *reduced), holdout)
        gains = [gain(before, after, seed=seed) for before in befores]
        noise = [noise_like(fit, r, c, seed=seed) for c, r in zip(kept, reduced, strict=True)]
        against = [
            noise[i] or objection(fit, c, g, first=i == 0)
            for i, (c, g) in enumerate(zip(kept, gains, strict=True))
        ]
        failing = [i for i, why in enumerate(against) if why]
        if not failing:
            findings = _findings(fit, kept, reduced, gains)
            return AdoptionResult(fit, findings, tuple(dropped), after)
        worst = min(failing, key=lambda i: (not noise[i], log_likelihood_gain(gains[i])))
        cause = kept.pop(worst)
        dropped.append(Dropped(cause.term.name, gains[worst], against[worst], choice=cause))
        fit = reduced[worst]


def objection(fit: CorrectedFit, choice: Choice, g: Gain, *, first: bool) -> str:
    """Return the reason why held-out data do not confirm the cause ``choice``, or "".

    ``g``: gain of the cause on held-out data. ``first``: True if the search found this cause before
    the other causes in ``fit``.
    """
    profile = fit.structure.profile
    if not meets_adoption_condition(choice, g, first=first) or worsens(g, profile):
        return DOES_NOT_PAY
    if not fit.is_corrected:
        of_base = choice.term.effect.of_base
        axes = AXES if of_base else unbiased_axes(fit)
        if not of_base and is_biased(fit, choice.term.axis):
            return LIMIT_CYCLE
        # Predictions hardly show backlash; its width is compared with a count (`within_a_count`).
        if choice.term.effect.name != BACKLASH and not exceeds_rounding(g, profile, axes=axes):
            return LIMIT_CYCLE if exceeds_rounding(g, profile) else WITHIN_ROUNDING
    return ""


def worsens(g: Gain, profile: Profile) -> bool:
    """Return whether predictions become worse: on an axis the RMSE increases, on none it decreases.

    A change counts if it is significant and exceeds the standard deviation of encoder rounding.
    """
    return exceeds_rounding(g, profile, increases=True) and not exceeds_rounding(g, profile)


def each_held_out(fits: Sequence[CorrectedFit], holdout: Sequence[Recording]) -> list[HeldOut]:
    """Evaluate each fit on the recordings ``holdout``; if there are none, by cross-validation."""
    return parallel_map(lambda i: held_out(fits[i], holdout), len(fits), what="fits")


def noise_like(fit: CorrectedFit, reduced: CorrectedFit, choice: Choice, *, seed: int) -> str:
    """Return the name of a kind of noise that explains the data no worse than ``choice`` does.

    ``choice`` is a cause that the search has selected; ``fit`` contains it, ``reduced`` does not.
    The name is `WITHIN_A_COUNT` for an encoder error of at most one count, `COLOURED` for coloured
    noise. If both explain the data worse than the cause does, the function returns "".
    """
    if within_a_count(fit, choice):
        return WITHIN_A_COUNT
    return COLOURED if is_coloured_noise(fit, reduced, choice, seed=seed) else ""


def is_coloured_noise(
    fit: CorrectedFit, reduced: CorrectedFit, choice: Choice, *, seed: int
) -> bool:
    """Return whether coloured noise explains the data no worse than the cause ``choice`` does.

    ``fit`` contains the cause, ``reduced`` does not. Z is the standardised score-test statistic of
    the cause. White noise rarely makes Z² exceed the threshold of the score test (`search.nulls`).
    Coloured noise makes the variance of Z larger by a factor ρ (`bias_correction.coloured_noise`).
    So the result is True if ρ > 1 and Z²/ρ is below the threshold. There are two exceptions:

    - For a torque that starts at an unknown instant, such as that of an added mass, the result is
      that of another test, `step_margin`.
    - For effects that only select a form of the rigid body's equations (`Effect.of_base`), the
      result is False.
    """
    effect = choice.term.effect
    if effect.of_base:
        return False
    if effect.scan == "instant":
        axis = max(choice.term.axis_index, 0)  # an added mass has no axis of its own: roll
        return step_margin(reduced, axis, seed=seed) < 1
    rho = float(fit.coloured_noise_factor[first_parameters(fit.free)[choice.term.name]])
    return rho > 1 and choice.candidates[0].statistic / rho < choice.threshold


def within_a_count(fit: CorrectedFit, choice: Choice) -> bool:
    """Return whether an encoder error of up to one count explains the data no worse than the cause.

    There are two cases:

    - The cause itself is encoder backlash or an encoder offset. Its size is that in ``fit``.
    - The cause is confounded with an encoder offset. The offset's size comes from another fit, with
      the offset in place of the cause.

    An encoder's zero is always uncertain by one count, because counts start at power-up.
    """
    for c in choice.candidates:
        axis, is_choice = c.term.axis, c.term.name == choice.term.name
        if axis is None or not (
            c.term.effect.name == OFFSET or (is_choice and c.term.effect.name == BACKLASH)
        ):
            continue
        if not is_choice and c.term.name not in choice.tied_with:
            continue
        count_deg = 360.0 / abs(getattr(c.problem.structure.profile.encoder, axis))
        j = first_parameters(fit.free).get(c.term.name) if is_choice else None
        size = c.problem.values(c.optimum.theta)[-1] if j is None else fit.values[j]
        if abs(size) <= count_deg:
            return True
    return False


def meets_adoption_condition(choice: Choice, g: Gain, *, first: bool) -> bool:
    """Return whether the gain ``g`` on held-out data suffices to adopt a cause.

    A significant gain suffices (`is_significant_gain`). A gain in log-likelihood of more than
    `MIN_GAIN` suffices in two cases:

    - The search found this cause before the other causes in the model (``first``).
    - The score of the cause is at least `SUFFICIENT`.
    """
    strong = first or choice.score >= SUFFICIENT
    return is_significant_gain(g) or (strong and log_likelihood_gain(g) > MIN_GAIN)


def is_significant_gain(g: Gain) -> bool:
    """Return whether the gain ``g`` suffices to adopt a cause, whatever the cause's score.

    Δℓ is the increase in the log-likelihood of held-out data. The gain suffices if one of these
    conditions holds:

    - The bootstrap interval of Δℓ lies above zero.
    - Δℓ > `LARGE_GAIN`, and the prediction error of an axis decreases significantly.
    """
    lower_error = any(i is not None and i.low > 0 for i in g.rmse_deg.values())
    return gain_interval_positive(g) or (lower_error and log_likelihood_gain(g) > LARGE_GAIN)


def fitted(
    base: CorrectedFit, result: AdoptionResult,
    train: Sequence[Recording], holdout: Sequence[Recording], *, seed: int,
) -> Fitted:  # fmt: skip
    """Return the base simulation and the extended model, with their prediction errors.

    The base simulation is the model to which the diagnosis adds causes: the rigid body, usually
    without effects. The extended model is the base simulation with the adopted causes and the
    terms for residual torques. The extended model has the parameter values of ``result.fit``.
    """
    fit, after = result.fit, result.after
    model = model_of(fit, train, "extended")
    at = model_at(fit.problem, fit.optimum.theta, fit.optimum.noise)
    nominal_model = nominal(train[0].profile, tuple(t.name for t in base.structure.terms))
    # With the base fit's noise, the error on a rig with these numbers is the noise floor.
    nominal_model = replace(nominal_model, noise=base.optimum.noise[:3])

    before = after if fit is base else held_out(base, holdout)
    uncalibrated = held_out(base, holdout, base.structure.scaled(base.structure.values_of({})))
    with_causes = None
    if fit is not base:
        with_causes = gain(held_out(fit, holdout, with_profile_numbers(fit)), after, seed=seed)
    wrong = simulation_error(nominal_model, holdout or train, truth=at, seed=seed)
    return Fitted(
        base, fit, model, gain(before, after, seed=seed), before, after, wrong,
        refit=gain(uncalibrated, before, seed=seed), refit_with_causes=with_causes,
        calibration=base_parameters(fit),
    )  # fmt: skip


def with_profile_numbers(fit: CorrectedFit) -> np.ndarray:
    """Return the scaled parameters (n,) of ``fit``, with the profile's trim torque and inertias.

    The parameters of effects keep their fitted values.
    """
    theta = fit.optimum.theta.copy()
    body = [f.term is None for f in fit.free]
    theta[body] = fit.structure.scaled(fit.structure.start)[body]
    return theta


def _findings(
    fit: CorrectedFit,
    choices: Sequence[Choice],
    reduced: Sequence[CorrectedFit],
    gains: Sequence[Gain],
) -> tuple[Finding, ...]:
    scale = thrust_scale(fit)
    formal = [t.name for t in fit.structure.formal]
    choices = without_mutual_ties(choices, formal)
    return tuple(
        with_size(Finding(c, {}, g, w.optimum.noise), fit, scale)
        for c, w, g in zip(choices, reduced, gains, strict=True)
    )


def with_size(finding: Finding, fit: CorrectedFit, scale: ThrustScale) -> Finding:
    """Return ``finding`` with the parameter values of ``fit``, and with limited confidence.

    The confidence in the finding is limited to `size_confidence`, the probability that its size has
    the estimated sign. ``scale`` converts values in units of the thrust gain K_f to SI.
    """
    name, c = finding.term.name, finding.choice
    return replace(
        finding,
        choice=replace(c, confidence=min(c.confidence, size_confidence(fit, name))),
        values=with_positive_torque(in_SI(fit, scale, name)),
    )


def size_confidence(fit: CorrectedFit, name: str) -> float:
    """Return the probability Φ(|v − v_0|/σ) that a term's size v − v_0 has the estimated sign.

    v is the term's first parameter, v_0 its value in a rig without the effect. A term without v_0,
    such as a limit, gives 1.
    """
    size = effect_size(fit, name)
    return 1.0 if size is None else float(normal_cdf(abs(size[0]) / size[1]))


def without_mutual_ties(choices: Sequence[Choice], formal: Sequence[str] = ()) -> list[Choice]:
    """Return the chosen causes ``choices``, no longer confounded with each other.

    ``tied_with`` of a cause names the candidates that are confounded with it. The function removes
    the names of the other chosen causes, and of the effects ``formal``. A formal effect only writes
    the rigid body's equations in another form.

    If it removes a name, the confidence becomes at least the posterior probability of the cause
    against the best of the remaining candidates (or against no effect). It is never lowered.
    """
    named = {c.term.name for c in choices} | set(formal)
    out = []
    for c in choices:
        tied = tuple(n for n in c.tied_with if n not in named)
        confidence = c.confidence
        if len(tied) < len(c.tied_with):
            others = [x.score for x in c.candidates if x.term.name not in named]
            confidence = max(confidence, certainty([c.score, max([0.0, *others])]))
        out.append(replace(c, tied_with=tied, confidence=confidence))
    return out


def log_likelihood_gain(g: Gain) -> float:
    assert g.log_likelihood is not None
    return g.log_likelihood.value


def with_positive_torque(
    values: Mapping[str, tuple[float, float]],
) -> dict[str, tuple[float, float]]:
    """Return the ``values`` of a periodic torque with a positive amplitude and a phase in (−π, π].

    A negative amplitude changes its sign, and π is added to the phase. ``values``: {parameter:
    (value, standard deviation)}; those of other effects are returned unchanged.
    """
    out = dict(values)
    if {"torque_Nm", "phase_rad"} <= out.keys():
        (torque, std), (phase, spread) = out["torque_Nm"], out["phase_rad"]
        shifted = phase + (math.pi if torque < 0 else 0.0)
        out["torque_Nm"] = abs(torque), std
        out["phase_rad"] = math.pi - (math.pi - shifted) % (2 * math.pi), spread
    return out
