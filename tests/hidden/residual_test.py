"""The plain residual test: are the innovations of the refitted base model white, and free of what
past voltages explain? (Ljung, "System Identification", 16.6.) It says *that* something is wrong,
never what.

The base is the same one that the diagnosis starts from. Innovations every 40 ms, whiteness over 20
lags and past inputs as `heli3dof identify` reports them, each against a multiple of its 99 % point:
at the point itself 29 of 30 flights fail in which nothing is hidden (the encoder's steps are no
white noise), so the multiples are those at which one of these 30 does (seeds 1000 to 1009 of the
three plans). A recording that cannot be fitted (its samples are late or lost) has failed as well.
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
"""In 99 % points."""


def document(recording: Recording) -> dict[str, Any]:
    """A document as the contract's: a failed test is an unexplained rest on no axis by name."""
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
