"""Check before a flight that the controller gain stabilises the chosen model of the rig.

If the gain does not, the functions raise UnstableLoop (exit code 6).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heli3dof.errors import UnstableLoop, UsageError
from heli3dof.model.base import Model
from heli3dof.model.control.closed_loop_poles import sampled_loop_poles
from heli3dof.model.linear.hover import hover_model
from heli3dof.model.linear.model import LinearModel
from heli3dof.rig.profile import ControllerSpec, Profile

MARGIN = 1e-4
"""rad/s; a pole with real part ≥ −`MARGIN` counts as unstable."""


def check_loop(model: Model, controller: ControllerSpec | None, dt: float) -> np.ndarray:
    """Return `Model.loop_poles` (rad/s, rightmost first); raise UnstableLoop if one is unstable.

    The exception names the poles with real part ≥ −`MARGIN` (rad/s). The hover model's poles are
    those of the continuous loop. For the hover model, this function also checks, but does not
    return, the poles of the loop that is sampled every ``dt`` s and has the derivative filter: a
    low sampling rate may destabilise that loop. Raises UsageError if there is no controller.
    """
    if not isinstance(controller, ControllerSpec):
        raise UsageError(
            f"controller is {controller!r}, not a profile's controller.",
            cause="the profile has no [controller], because the log's controller is unknown.",
            fix="profile.with_controller().controller is the default one",
        )
    poles = model.loop_poles(controller, dt)
    _check(
        poles,
        f"the model {model.name!r}",
        _cause(model),
        "fly another gain ([controller] K in the profile) or check it on the corrected model "
        "(model='hover')",
    )
    if isinstance(model, LinearModel) and model.physical_state:
        _check(
            sampled_loop_poles(model, controller, dt),
            f"the model {model.name!r} at {1 / dt:g} Hz",
            "the loop, or its derivative filter, is too slow for this gain.",
            "raise [loop] rate_hz or [controller] derivative_cutoff_hz in the profile",
        )
    return poles


def _check(poles: np.ndarray, loop: str, cause: str, fix: str) -> None:
    unstable = poles[~(poles.real < -MARGIN)]
    if len(unstable):
        raise UnstableLoop(
            f"The gain does not stabilise {loop}: {_poles(unstable)} not left of zero.",
            cause=cause,
            fix=fix,
        )


def check_hover_loop(profile: Profile) -> np.ndarray:
    """Return the hover model's closed-loop poles (rad/s); raise UnstableLoop if one is unstable."""
    controller = profile.with_controller().controller
    assert controller is not None
    return check_loop(hover_model(profile), controller, profile.dt)


def _cause(model: Model) -> str:
    if model.kind == "hover_printed":
        return "eq (10) as printed has the wrong sign at A[6,2] (erratum E3); K_g is right."
    if model.kind == "paper17":
        return "eq (17) is defective (erratum E14): no reading of it is stable with K_g."
    return "the gain has a wrong sign or was designed for another rig, or the model is poor."


def _poles(poles: Sequence[complex] | np.ndarray) -> str:
    """Return subject and verb of a sentence about poles, such as "the pole +1.469 rad/s is"."""
    words = []
    for s in poles:
        if abs(s.imag) < 1e-9:
            words.append(f"{s.real:+.3f}")
        elif s.imag > 0:
            words.append(f"{s.real:+.3f} ± {s.imag:.3f}j")
    one = len(words) == 1 and "±" not in words[0]
    shown = ", ".join(words[:4]) + (", …" if len(words) > 4 else "")
    return f"the pole {shown} rad/s is" if one else f"the poles {shown} rad/s are"
