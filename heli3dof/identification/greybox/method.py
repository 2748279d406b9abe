"""Fit physical parameters by maximum likelihood: `fit` for ``identify``, `fit_greybox` for scripts.

A term is an effect of the grey-box model, with its axis if the effect acts on a single axis:
``motor.lag``, ``friction.viscous.yaw``. Every rig has the effects in `DEFAULT_TERMS`: pendulum
stiffness, viscous friction, rotor lag, and constant torques on pitch and yaw (trims).
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from heli3dof.errors import UsageError, did_you_mean
from heli3dof.identification.closed_loop_fit.identify_correction import (
    correction_note,
    without_bias,
)
from heli3dof.identification.fit_result import FitResult, Parameter, Request
from heli3dof.identification.greybox.estimate import Estimate, estimate
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.linear_uncertainty import fit_result
from heli3dof.identification.greybox.maximum_likelihood import compile_first
from heli3dof.identification.greybox.structure_test import with_simplifications
from heli3dof.identification.preprocessing import (
    Prepared,
    moving_axes_only,
    still_axes,
)
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.effects import terms
from heli3dof.model.estimation.filter_data import RowRange, data_of
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.logs.sampling_jitter import motion_jitter
from heli3dof.recording.recording import Recording

DEFAULT_TERMS = (
    "stiffness.pendulum.roll",
    "stiffness.pendulum.pitch",
    "friction.viscous.roll",
    "friction.viscous.pitch",
    "friction.viscous.yaw",
    "motor.lag",
    "bias.torque.pitch",
    "bias.torque.yaw",
)
JITTER_SHARE = 0.2
"""Sampling jitter as a share of the sample period. Below this share, maximum likelihood, whose
filter models jitter, gives better estimates than the multi-step fit."""


def fit(prepared: Prepared, request: Request) -> FitResult:
    """Return a maximum-likelihood fit of a grey-box model to recordings.

    The data are the training part of the recordings ``prepared``, and the recordings
    ``request.partial``, in which an angle was not measured. ``request.terms`` names the effects
    whose parameters are fitted. If it is None, the effects are `DEFAULT_TERMS`. In this case the
    fit also tests whether simplified equations of motion fit much better
    (`greybox.structure_test`). If the controller is known, simulated flights correct the bias
    (`closed_loop_fit.identify_correction`).
    """
    chosen = DEFAULT_TERMS if request.terms is None else request.terms
    given = [*prepared.recordings, *request.partial]
    several = [moving_axes_only(r) for r in given]
    runs: list[RowRange] = list(prepared.train)
    for i, recording in enumerate(request.partial, start=len(prepared.recordings)):
        runs += usable_runs(recording, i)
    structure = Structure(given[0].profile, terms(moving_terms(chosen, given)))
    problem = Likelihood(data_of(several, runs), structure)
    compile_first(problem)
    found = estimate(problem)
    if request.terms is None:
        found = with_simplifications(found)
    found = without_bias(found, several)
    sources = sorted({r.source for r in runs})
    model = model_of(found, [given[i] for i in sources], request.name)
    return fit_result(
        found,
        model,
        prepared.dt,
        parameters=parameters(found),
        warnings=warnings(found),
        notes=(*(t.effect.summary for t in found.structure.formal), *correction_note(found)),
    )


def moving_terms(names: Sequence[str], recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Return the terms called ``names``, without those on an axis that moves in no recording."""
    still = still_axes(recordings)
    return tuple(t.name for t in terms(names) if t.axis not in still)


def has_jitter(recording: Recording) -> bool:
    """Return True if the motion shows sampling jitter above `JITTER_SHARE` of the sample period."""
    r = recording
    m = motion_jitter(r.t, r.angle, r.profile.encoder.rad_per_count)
    return m.is_significant and m.sigma_s > JITTER_SHARE * r.dt


def chosen_terms(words: str | Sequence[str]) -> tuple[str, ...]:
    """Return the names of the effects that ``words`` selects.

    ``words`` is text with commas, or a list of words. ``+name,-name`` adds to and removes from
    `DEFAULT_TERMS`; ``name,name`` is the full list. Raises UsageError for an unknown name, or for a
    ``-name`` that cannot be removed.
    """
    if not isinstance(words, str):
        if not words:
            return ()
        words = ",".join(words)
    names = [w.strip() for w in words.split(",") if w.strip()]
    chosen = [] if names and names[0][0] not in "+-" else list(DEFAULT_TERMS)
    for word in names:
        name = word.lstrip("+-")
        if word.startswith("-"):
            if name not in chosen:
                raise UsageError(
                    f"There is no term {name!r} to leave out.",
                    cause=f"a typing error; {did_you_mean(name, chosen)}",
                    fix=f"the default terms: {', '.join(DEFAULT_TERMS)}",
                )
            chosen.remove(name)
        elif name not in chosen:
            chosen.append(name)
    terms(chosen)
    return tuple(chosen)


def fit_greybox(
    recordings: Recording | Sequence[Recording], names: Sequence[str] = DEFAULT_TERMS
) -> Estimate:
    """Return physical parameters, fitted to recordings of one rig by maximum likelihood.

    `model_of` converts the result to a model. A recording may contain a single angle (the fit then
    holds the other axes at rest), and its controller may be unknown.
    `heli3dof.identification.row_selection` selects the rows. Unlike ``identify``, the function
    neither corrects the bias (`closed_loop_fit.identify_correction`) nor simplifies the equations.

    Args:
        recordings: one or several.
        names: the terms to fit, besides the inertias and the gravity torque.

    Raises RecordingError where no rows are left, UsageError for an unknown term.
    """
    several = [recordings] if isinstance(recordings, Recording) else list(recordings)
    runs = [run for i, r in enumerate(several) for run in usable_runs(r, i)]
    structure = Structure(several[0].profile, terms(names))
    return estimate(Likelihood(data_of(several, runs), structure))


def model_of(found: Estimate, recordings: Sequence[Recording], name: str) -> GreyBoxModel:
    """Return the fitted model called ``name``, with names and digests of its recordings."""
    extra: dict[str, Any] = {
        "method": "greybox",
        "recordings": [{"name": r.name, "sha256": r.digest} for r in recordings],
        "heli3dof": version("heli3dof"),
        "log_likelihood": found.optimum.loglik,
        "converged": found.optimum.converged,
        "inflation": found.inflation,
        "cramer_rao_bound": found.bound.tolist(),
        "verdicts": [v for v in found.verdicts if v],
    }
    return GreyBoxModel(
        name=name,
        profile=found.structure.profile,
        terms=tuple(t.name for t in found.structure.terms),
        values=found.values,
        noise=found.optimum.noise[:3],
        jitter_s=float(found.optimum.noise[3]),
        covariance=found.covariance,
        extra=extra,
    )


def parameters(found: Estimate) -> dict[str, Parameter]:
    """Return {name: parameter}: value, standard deviation, Cramér–Rao bound, warning or ``""``.

    Let v_0 be the value at which a parameter's effect vanishes (0 for most parameters). If the fit
    does not find the effect (`PhysicalFit.absent`), the returned standard deviation is raised to at
    least value − v_0. Then v_0 is within one standard deviation of the value.
    """
    least = np.where(found.absent, found.values - [f.null for f in found.free], 0.0)
    std = np.maximum(found.std, least)
    return {
        f.name: Parameter(
            float(v), float(s), f.unit, float(b), f.start if f.term is None else f.null, w, bool(a)
        )
        for f, v, s, b, w, a in zip(
            found.free, found.values, std, found.bound, found.verdicts, found.absent, strict=True
        )
    }


def warnings(found: Estimate) -> tuple[str, ...]:
    """Return warnings: no convergence, unexplained motion, parameters at a bound or uncertain."""
    out = [v for v in found.verdicts if v]
    o = found.optimum
    if not o.converged:
        out.append(
            f"The fit had not converged after {o.rounds} rounds. Likely cause: motion that no "
            "term explains, or too little motion. Try other terms: heli3dof identify … --terms "
            "+NAME"
        )
    out += [
        f"{f.name} is at its bound, {v:.4g} {f.unit}: it probably compensates another effect."
        for f, v, stuck, absent in zip(
            found.free, found.values, o.at_bound, found.absent, strict=True
        )
        if stuck and not absent
    ]
    if found.unexplained_scatter > 2:
        out.append(
            f"The scores scatter {found.unexplained_scatter:.1f} times as much as white noise "
            "allows: slow torque noise, such as draughts, or an effect without a term moves the "
            "rig. Standard deviations account for both, but an effect also causes biases. To find "
            "one: heli3dof diagnose REC"
        )
    return tuple(out)
