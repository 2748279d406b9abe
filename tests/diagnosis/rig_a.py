"""Recordings of the real rig A and a quick fit of one; tests skip if the data are missing."""

from __future__ import annotations

from functools import cache

import pytest

import heli3dof as h3
from heli3dof.identification.greybox.freeflight import problem_of
from heli3dof.identification.greybox.multistep import MultiStepFit, search
from heli3dof.identification.greybox.weak_form import weak_start
from heli3dof.recording.recording import Recording
from tests.paths import REAL_DATA

RIG_A = REAL_DATA / "rig-a"


def recording(name: str) -> Recording:
    """The recording of that name; skips the test if the data folder is missing."""
    if not RIG_A.is_dir():
        pytest.skip("the real recordings are missing")
    return h3.load(RIG_A / f"{name}.csv", h3.load_profile(RIG_A / "profile.toml"))


@cache
def quick() -> MultiStepFit:
    """Fit of closed-1a by free-run predictions of 1 s, two rounds: close, but not converged."""
    problem = problem_of([recording("closed-1a")])
    return search(problem, weak_start(problem), stages_s=((0.25, 0.5, 1.0),), rounds=2)
