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
further ones                an object of the type that the function's docstring states
==========================  ==================================================================
"""

from __future__ import annotations

import inspect
import math
import operator
import os
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
Conversion = Callable[[str, Any, Given], Any]
"""(name of the argument, its value, all arguments) → converted value"""


def converted(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return ``function`` with its arguments converted by `CONVERSIONS`."""
    signature = inspect.signature(function)
    names = [name for name in CONVERSIONS if name in signature.parameters]
    if not names:
        return function
    optional = {p.name for p in signature.parameters.values() if str(p.annotation).endswith("None")}

    @wraps(function)
    def call(*args: Any, **options: Any) -> Any:
        bound = signature.bind(*args, **options)
        given = bound.arguments
        for name in names:
            if name not in given or given[name] is signature.parameters[name].default:
                continue
            if given[name] is not None or name not in optional:
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

    if isinstance(value, Profile):
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
    """Convert the argument ``models`` into a function that returns the models for a recording.

    ``value`` is the argument. If it is a function, it is returned unchanged. Otherwise, it is one
    model or several; each is a model object, or the name or path of a model. The returned function
    loads the named models for the profile of its recording. ``name``: the parameter's name, for
    error messages. ``given`` is not used.
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
    """Return ``value`` unchanged, after a check: one or several positive numbers."""
    try:
        good = all(0 < v < math.inf for v in _several(value))
    except (TypeError, ValueError):
        good = False
    if not good:
        raise UsageError(
            f"{name} is {value!r}; it must be positive.",
            cause="a wrong sign, or text where a number belongs.",
            fix=f"{name} in {'Hz' if name.endswith('_hz') else 'seconds'}, above 0",
        )
    return value


def _positives(name: str, value: Any, given: Given) -> list[Any]:
    """Return one or several positive numbers as a list."""
    several = _several(_positive(name, value, given))
    if not several and name == "intervals_s":
        raise UsageError(
            "intervals_s is empty.",
            cause="a list without elements; the order search needs an interval.",
            fix="intervals_s=[0.04], in seconds; or leave it out",
        )
    return several


def _three_angles(name: str, value: Any, given: Given) -> tuple[Any, ...]:
    try:
        angles = tuple(None if v is None else float(v) for v in value)
    except (TypeError, ValueError):
        angles = ()
    if len(angles) != 3 or not all(a is None or math.isfinite(a) for a in angles):
        raise UsageError(
            f"{name} is {value!r}; it must be three angles in degrees: roll, pitch, yaw.",
            cause="an axis was left out, or an angle is no finite number.",
            fix=f"{name}=(10, None, None) for roll alone"
            + ("; or step_plan(roll=10)" if name == "target_deg" else ""),
        )
    return angles


def _number(name: str, value: Any, given: Given) -> float:
    """Return a finite number."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise _wrong(name, value, "a finite number", f"{name}=10")
    return number


def _whole(name: str, value: Any, given: Given) -> int:
    try:
        return operator.index(value)
    except TypeError:
        raise _wrong(name, value, "a whole number", f"{name}=8") from None


def _text(name: str, value: Any, given: Given) -> str:
    if not isinstance(value, str):
        raise _wrong(name, value, "a text", f"{name}='…'")
    return value


def _path(name: str, value: Any, given: Given) -> Any:
    if not isinstance(value, str | os.PathLike):
        raise _wrong(name, value, "a path: a text or a pathlib.Path", f"{name}='flights/a.mcap'")
    return value


def _each(check: Conversion) -> Conversion:
    """Return a conversion for an argument that is one object or several objects.

    The conversion calls ``check`` for each object. It returns an iterable as a list, and a single
    object unchanged.
    """

    def checked(name: str, value: Any, given: Given) -> Any:
        several = _several(value)
        for element in several:
            check(name, element, given)
        return value if len(several) == 1 and several[0] is value else several

    return checked


def _paths(name: str, value: Any, given: Given) -> Any:
    paths = _each(_path)(name, value, given)
    if not paths:
        raise UsageError(
            "No log was given.",
            cause=f"the list {name} is empty.",
            fix="heli3dof.import_log('log.csv', profile)",
        )
    return paths


def _mapping(name: str, value: Any, given: Given) -> Any:
    texts = [*value.keys(), *value.values()] if isinstance(value, Mapping) else [None]
    if not all(isinstance(text, str) for text in texts):
        wanted = "a dict: column → expression of the log's columns"
        raise _wrong(name, value, wanted, f"{name}={{'roll_deg': '57.3*x[5]'}}")
    return value


def _metadata(name: str, value: Any, given: Given) -> Any:
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise _wrong(name, value, "a dict whose keys are texts", f"{name}={{'name': 'first'}}")
    return value


def _function(name: str, value: Any, given: Given) -> Any:
    if not callable(value):
        raise _wrong(name, value, "a function", f"{name}=print, or leave it out")
    return value


def _diagnosis(name: str, value: Any, given: Given) -> Any:
    if not (hasattr(value, "verdict") and hasattr(value, "findings")):
        raise _wrong(name, value, "a diagnosis", "heli3dof.diagnose(recording)")
    return value


def _diagnosed(name: str, value: Any, given: Given) -> Any:
    is_document_with_data = hasattr(value, "document") and hasattr(value, "data")
    return value if is_document_with_data else _diagnosis(name, value, given)


def _identification(name: str, value: Any, given: Given) -> Any:
    if not (hasattr(value, "found") and hasattr(value, "metrics")):
        raise _wrong(name, value, "an identification", "heli3dof.identify(recording)")
    return value


def _comparison(name: str, value: Any, given: Given) -> Any:
    if not (hasattr(value, "flights") and hasattr(value, "horizons_s")):
        raise _wrong(name, value, "a comparison", "heli3dof.compare(recording, 'hover')")
    return value


def _diagnosis_document(name: str, value: Any, given: Given) -> Any:
    schema = value.get("schema", "") if isinstance(value, Mapping) else ""
    if not str(schema).startswith("heli3dof.diagnosis/"):
        raise _wrong(name, value, "the JSON document of a diagnosis", "diagnosis.to_dict()")
    return value


CONVERSIONS: Mapping[str, Conversion] = {
    "profile": _profile,
    "plan": _plan,
    "first": _plan,
    "recording": _recording,
    "recordings": _recordings,
    "holdout": _recordings,
    "model": _model,
    "identified": lambda name, value, given: [
        _identification(name, one, given) for one in _several(value)
    ],
    "models": _models,
    "seed": _seed,
    "horizons_s": _positives,
    "intervals_s": _positives,
    "dt": _positive,
    "rate_hz": _positive,
    "target_deg": _three_angles,
    "angles_deg": _three_angles,
    **dict.fromkeys(("roll", "pitch", "yaw", "settle_s", "duration_s"), _number),
    "budget_min": _number,
    "order": _whole,
    **dict.fromkeys(("device", "method", "base", "title", "name", "reason"), _text),
    **dict.fromkeys(("terms", "columns"), _each(_text)),
    **dict.fromkeys(("path", "name_or_path", "output", "folder"), _path),
    "paths": _paths,
    "mapping": _mapping,
    "meta": _metadata,
    **dict.fromkeys(("progress", "each", "opened", "warn"), _function),
    **dict.fromkeys(("found", "d"), _diagnosis),
    "diagnosed": _diagnosed,
    "comparison": _comparison,
    "document": _diagnosis_document,
}
"""Parameter → conversion (name, argument, all arguments), in the order in which they are applied"""
