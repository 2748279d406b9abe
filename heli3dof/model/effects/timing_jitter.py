"""Sampling jitter: samples are taken at k dt + ε, ε of this standard deviation.

If the time stamps are the true instants, they show it and a fit uses them without loss. If they are
counted periods, the readings have an error of rate times ε, which the filter estimates as one of
its noises (`heli3dof.model.estimation.quantised_measurement`).
"""

from __future__ import annotations

from heli3dof.model.effects.base import Effect, Parameter

EFFECT = Effect(
    name="timing.jitter",
    summary="Samples are taken early or late.",
    parameters=(Parameter("jitter_s", "s", 0.0, 0.0, 0.01, 0.0002, "standard deviation"),),
    hooks={},
    confused_with=("timing.gaps",),
    separated_by="steps",
    identifiable="any recording whose time stamps are the device's",
    evidence="time",
)
