"""Samples are taken early or late: at k dt + ε, ε of this standard deviation.

Seen in the time stamps where they tell the true instants; then a fit follows them and loses
nothing. Where the stamps are a counter's, the readings are off by rate times ε, which the filter
estimates as the jitter among its noises (`heli3dof.model.estimation.quantised_measurement`).
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
