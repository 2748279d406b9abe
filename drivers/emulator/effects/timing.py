"""Sampling jitter and lost samples.

Jitter: sample k is taken at k dt + ε, with the control period dt. ε is drawn from a normal
distribution with the given standard deviation and clipped to ±0.4 dt. The device's time stamps are
the true instants. Gaps: each sample is lost with probability ``lost_share``; then the device holds
the voltage for a further period, and the time stamps have a gap.
"""

from __future__ import annotations

from dataclasses import replace

from ..body import Setup
from .base import Effect, Parameter


def _gaps(setup: Setup, axis: int, values: tuple[float, ...]) -> Setup:
    return replace(setup, lost_share=values[0])


def _jitter(setup: Setup, axis: int, values: tuple[float, ...]) -> Setup:
    return replace(setup, jitter_s=values[0])


EFFECTS = (
    Effect(
        name="timing.gaps",
        summary="Samples are lost; the voltage is held.",
        parameters=(Parameter("lost_share", "–", 0.0, 0.5, "share of the samples"),),
        example="timing.gaps:0.01",
        setup=_gaps,
    ),
    Effect(
        name="timing.jitter",
        summary="Samples are taken early or late; their time stamps are the true instants.",
        parameters=(Parameter("jitter_s", "s", 0.0, 0.01, "standard deviation"),),
        example="timing.jitter:0.0002",
        setup=_jitter,
    ),
)
