"""Samples get lost on their way: this share of those between the first and the last.

With one sample in every period but n lost of N, lost_share = n/N; seen in the time stamps, which
step by more than a period. Nothing acts on the rig: a fit leaves the gaps out.
"""

from __future__ import annotations

from heli3dof.model.effects.base import Effect, Parameter

EFFECT = Effect(
    name="timing.gaps",
    summary="Samples get lost on their way.",
    parameters=(Parameter("lost_share", "–", 0.0, 0.0, 1.0, 0.01, "share of the samples"),),
    hooks={},
    confused_with=("timing.jitter",),
    separated_by="steps",
    identifiable="any recording whose time stamps are the device's",
    evidence="time",
)
