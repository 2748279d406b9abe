"""Effects on the sampling instants: lost samples and jitter. The equations do not contain them.

``timing.gaps``, lost samples: the parameter is n/N if n of N samples are lost. The time stamps show
a loss, because the interval between two rows is longer than a period. A fit skips the gaps.

``timing.jitter``, sampling jitter: sample k is taken at k dt + ε. The parameter is the standard
deviation of ε. If the time stamps are the true instants, they show ε, and a fit loses no accuracy.
If they are only k dt, a reading has an error of rate times ε. The filter then models this error as
noise, whose size is estimated (`heli3dof.model.estimation.quantised_measurement`).
"""

from __future__ import annotations

from heli3dof.model.effects.base import Effect, Parameter

EFFECTS = (
    Effect(
        name="timing.gaps",
        summary="Samples are lost.",
        parameters=(Parameter("lost_share", "–", 0.0, 0.0, 1.0, 0.01, "share of the samples"),),
        hooks={},
        confused_with=("timing.jitter",),
        separated_by="steps",
        identifiable="any recording whose time stamps are the device's",
        evidence="time",
    ),
    Effect(
        name="timing.jitter",
        summary="Samples are taken early or late.",
        parameters=(Parameter("jitter_s", "s", 0.0, 0.0, 0.01, 0.0002, "standard deviation"),),
        hooks={},
        confused_with=("timing.gaps",),
        separated_by="steps",
        identifiable="any recording whose time stamps are the device's",
        evidence="time",
    ),
)
