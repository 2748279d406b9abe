"""The standard residual test: whiteness of the refitted base model's innovations, and their
independence of past voltages (Ljung, "System Identification", 16.6). It detects an error of the
model but not its cause.

The diagnosis starts from the same base. Innovations are taken every 40 ms. Whiteness over 20 lags
and past inputs are those of `heli3dof identify`. The limit of each is a multiple of its 99 % point.
At the point itself 29 of 30 flights without a hidden effect fail, because encoder steps are not
white noise. At the multiples one of the 30 fails (seeds 1000 to 1009 of the three plans). A
recording that cannot be fitted (late or lost samples) fails as well.
"""

from __future__ import annotations

from typing import Any

from heli3dof.errors import RecordingError
from heli3dof.identification.greybox.linear_uncertainty import innovations
from heli3dof.identification.greybox.method import fit_greybox, model_of
from heli3dof.identification.preprocessing import prepare
from heli3dof.identification.residual_tests import past_inputs, whiteness
from heli3dof.recording.recording import Recording

BOUNDS = {"whiteness": 5.0, "past inputs": 2.0}
"""Limit of each statistic over its 99 % point."""


def document(recording: Recording) -> dict[str, Any]:
    """A document of the contract: a failed test is a residual torque without an axis."""
    try:
        model = model_of(fit_greybox([recording], ()), [recording], "base")
        prepared = prepare([recording], held_out=[recording])
    except RecordingError:
        return {"verdict": "bad_data", "findings": [], "leftover": []}
    e, u = innovations(model, prepared, prepared.train)
    tests = {"whiteness": whiteness(e), "past inputs": past_inputs(e, u)}
    about = {name: test.statistic / test.bound for name, test in tests.items()}
    failed = [name for name, ratio in about.items() if ratio > BOUNDS[name]]
    return {
        "verdict": "unexplained" if failed else "nothing_found",
        "findings": [],
        "leftover": [{"axis": None, "depends_on": name} for name in failed],
        "about": about,
    }
