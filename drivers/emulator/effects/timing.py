"""Sampling jitter and lost samples.

Jitter: sample k is taken at k dt + ε. ε is normally distributed with the given standard deviation,
|ε| at most 0.4 of a period; the device's time stamps are the true instants. Gaps: samples are lost
at random, each with probability ``lost_share``. The voltage is then held and the time stamps have a
gap.
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
