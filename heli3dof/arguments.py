"""Convert and check the arguments of the public functions, in one place.

`heli3dof.__getattr__` passes each public function through `converted`. The package's own calls do
not use this module. The parameter's name selects the conversion (`CONVERSIONS`):

==========================  ==================================================================
parameter                   argument
==========================  ==================================================================
``profile``                 a profile, or the path of its file
``plan``, ``first``         a plan, or its name or path
``recording``               a recording, or the path of its file
``recordings, holdout``     one or several of these
``model``                   a model, or its name or path
``models``                  one or several of these; or a function: recording → models
``identified``              one or several identifications
``seed``                    a whole number ≥ 0
``horizons_s, intervals_s`` positive numbers
``dt``, ``rate_hz``         a positive number
``target_deg, angles_deg``  three angles, of roll, pitch and yaw
==========================  ==================================================================
"""

from __future__ import annotations

import inspect
import math
import operator
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heli3dof.errors import RecordingError, UsageError

if TYPE_CHECKING:
    from heli3dof.recording.recording import Recording

SHOWN = 40
"""Largest number of characters of an argument in a message; a longer one is named by its type"""
Given = Mapping[str, Any]
"""A call's arguments by the parameter's name, converted in the order of `CONVERSIONS`"""


def converted(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return ``function`` with its arguments converted by `CONVERSIONS`."""
    signature = inspect.signature(function)
    names = [name for name in CONVERSIONS if name in signature.parameters]
    if not names:
        return function

    @wraps(function)
    def call(*args: Any, **options: Any) -> Any:
        bound = signature.bind(*args, **options)
        given = bound.arguments
        for name in names:
            default = signature.parameters[name].default
            if name in given and given[name] is not default:
                given[name] = CONVERSIONS[name](name, given[name], given)
        return function(*bound.args, **bound.kwargs)

    call.__module__ = "heli3dof"  # where pickle finds it
    return call


def _wrong(name: str, value: Any, wanted: str, fix: str) -> UsageError:
    shown = repr(value)
    found = shown if len(shown) <= SHOWN else f"of the type {type(value).__name__}"
    return UsageError(
        f"{name} is {found}, not {wanted}.",
        cause="another object was passed, or the arguments are in another order.",
        fix=fix,
    )


def _profile(name: str, value: Any, given: Given) -> Any:
    from heli3dof.rig.profile import Profile, load_profile

    if value is None or isinstance(value, Profile):
        return value
    if isinstance(value, str | Path):
        return load_profile(value)
    raise _wrong(name, value, "a profile or the path of its file", "heli3dof.default_profile()")


def _plan(name: str, value: Any, given: Given) -> Any:
    from heli3dof.experiment.plan import Plan, load_plan

    if isinstance(value, Plan):
        return value
    if isinstance(value, str | Path):
        return load_plan(value)
    raise _wrong(name, value, "a plan, its name or its path", "heli3dof.load_plan('rich')")


def _recording(name: str, value: Any, given: Given) -> Recording:
    from heli3dof.recording.load import load
    from heli3dof.recording.recording import Recording, check_samples

    recording = load(value) if isinstance(value, str | Path) else value
    if not isinstance(recording, Recording):
        raise _wrong(
            name, value, "a recording or the path of its file",
            "heli3dof.load(path); a flight has its own: flight.recording",
        )  # fmt: skip
    check_samples(recording, name)
    return recording


def _recordings(name: str, value: Any, given: Given) -> list[Recording]:
    several = _several(value)
    if not several and name == "recordings":
        raise RecordingError(
            "No recording was given.",
            cause="the list of recordings is empty.",
            fix="heli3dof.load(path)",
        )
    one = len(several) == 1
    return [_recording(name if one else f"{name}[{k}]", r, given) for k, r in enumerate(several)]


def _several(value: Any) -> list[Any]:
    """Return the elements of an iterable; a text, a recording or a model is a single element."""
    from heli3dof.recording.recording import Recording

    is_single = isinstance(value, str | Path | Recording) or not isinstance(value, Iterable)
    return [value] if is_single else list(value)


def _model(name: str, value: Any, given: Given) -> Any:
    from heli3dof.paper.models import load_model

    if isinstance(value, str | Path):
        return load_model(value, given.get("profile"))
    if not (hasattr(value, "fly") and hasattr(value, "predict")):
        raise _wrong(
            name, value, "a model, its name or its path",
            "heli3dof.load_model('hover'); an identification has its own: identified.model",
        )  # fmt: skip
    return value


def _models(name: str, value: Any, given: Given) -> Any:
    """Return a function: recording → models; a ``value`` that is a function is returned unchanged.

    The function makes a built-in model for the recording's profile.
    """
    if callable(value):
        return value

    several = _several(value)

    def models(recording: Recording | None) -> list[Any]:
        rig = {} if recording is None else {"profile": recording.profile}
        return [_model(f"{name}[{k}]", model, rig) for k, model in enumerate(several)]

    models(None)  # an unusable argument is an error of this call
    return models


def _seed(name: str, value: Any, given: Given) -> int:
    try:
        seed = operator.index(value)
    except TypeError:
        seed = -1
    if seed < 0:
        raise _wrong(name, value, "a whole number from 0", f"{name}=0")
    return seed


def _positive(name: str, value: Any, given: Given) -> Any:
    """Return ``value`` unchanged, after a check: one or several positive numbers, or None."""
    try:
        good = value is None or all(0 < float(v) < math.inf for v in _several(value))
    except (TypeError, ValueError):
        good = False
    if not good:
        raise UsageError(
            f"{name} is {value}; it must be positive.",
            cause="a wrong sign, or text where a number belongs.",
            fix=f"{name} in {'Hz' if name.endswith('_hz') else 'seconds'}, above 0",
        )
    return value


def _positives(name: str, value: Any, given: Given) -> list[Any]:
    """Return one or several positive numbers as a list."""
    return _several(_positive(name, value, given))


def _three_angles(name: str, value: Any, given: Given) -> tuple[Any, ...]:
    try:
        angles = tuple(None if v is None else float(v) for v in value)
    except (TypeError, ValueError):
        angles = ()
    if len(angles) != 3:
        raise UsageError(
            f"{name} is {value!r}; it must be three angles in degrees: roll, pitch, yaw.",
            cause="an axis was left out.",
            fix=f"{name}=(10, None, None) for roll alone"
            + ("; or step_plan(roll=10)" if name == "target_deg" else ""),
        )
    return angles


CONVERSIONS: Mapping[str, Callable[[str, Any, Given], Any]] = {
    "profile": _profile,
    "plan": _plan,
    "first": _plan,
    "recording": _recording,
    "recordings": _recordings,
    "holdout": _recordings,
    "model": _model,
    "identified": lambda name, value, given: _several(value),
    "models": _models,
    "seed": _seed,
    "horizons_s": _positives,
    "intervals_s": _positives,
    "dt": _positive,
    "rate_hz": _positive,
    "target_deg": _three_angles,
    "angles_deg": _three_angles,
}
"""Parameter → conversion (name, argument, all arguments), in the order in which they are applied"""
