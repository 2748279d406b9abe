"""Lost samples: the parameter is n/N for n lost of the N samples between the first and the last.

The time stamps show lost samples: the interval between two rows is longer than a period. The effect
has no equation; a fit skips the gaps.
"""

from __future__ import annotations

from heli3dof.model.effects.base import Effect, Parameter

EFFECT = Effect(
    name="timing.gaps",
    summary="Samples are lost.",
    parameters=(Parameter("lost_share", "–", 0.0, 0.0, 1.0, 0.01, "share of the samples"),),
    hooks={},
    confused_with=("timing.jitter",),
    separated_by="steps",
    identifiable="any recording whose time stamps are the device's",
    evidence="time",
)
