"""A real rig's recordings and a quick fit of one, for tests that skip where they are not."""

from __future__ import annotations

from functools import cache

import pytest

import heli3dof as h3
from heli3dof.identification.greybox.freeflight import problem_of
from heli3dof.identification.greybox.multistep import Fitted, search
from heli3dof.identification.greybox.weak_form import weak_start
from heli3dof.recording.recording import Recording
from tests.paths import REAL_DATA

RIG_A = REAL_DATA / "rig-a"


def recording(name: str) -> Recording:
    """That file; skips the test where there is none."""
    if not RIG_A.is_dir():
        pytest.skip("the real recordings are not here")
    return h3.load(RIG_A / f"{name}.csv", h3.load_profile(RIG_A / "profile.toml"))


@cache
def quick() -> Fitted:
    """closed-1a in free flights of 1 s, two rounds: near, not settled."""
    problem = problem_of([recording("closed-1a")])
    return search(problem, weak_start(problem), stages_s=((0.25, 0.5, 1.0),), rounds=2)
