"""Convert the results of a diagnosis or a grey-box fit to keys of a profile.

    key of the profile         new value
    motor.V_o                  V_h, the voltage of level hover of the model with its effects
    motor.K_f                  F_h/V_h, with the thrust F_h of a motor at level hover
    inertia.<axis>             J_<axis>
    encoder.<axis>_rest_deg    old value − offset, for the cause encoder.offset (reading = angle +
                               offset)
    encoder.<axis>             old value · c, for the cause encoder.scale (reading = rest +
                               c (angle − rest)); −old value, if the integrity check encoder.sign
                               finds the wrong sign

A flight does not identify the thrust gain K_f (N/V). So a model is fitted with the K_f of its
profile, and its trim torque T_g (N·m), inertias J (kg·m²) and thrust F_h (N) are in proportion to
this K_f. `greybox.thrust_scale` estimates the ratio k of the rig's thrust gain to the profile's.
T_g, J and F_h are multiplied by k, as in ``diagnose --json``. V_h does not depend on K_f.

In a profile, thrust is proportional to the voltage: thrust = K_f · voltage. The thrust of the rig
may be nonlinear (dead zone, rotor curve). Then, too, motor.V_o = V_h and motor.K_f = F_h/V_h give
the right voltage and thrust at level hover (`LevelHover`).

Causes without a key (friction, lag, …) and confounded causes do not change the profile;
`Calibration.left_out` lists them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.errors import RecordingError, UsageError, quoted
from heli3dof.file_kind import no_file
from heli3dof.identification.greybox.thrust_scale import (
    BASE,
    TORQUE_UNITS,
    Measured,
    thrust_scale,
)
from heli3dof.model.greybox.linearisation import LevelHover, level_hover
from heli3dof.rig.profile import Profile
from heli3dof.rig.profile_file import Change

DIGITS = 5
"""Significant digits of a number in the profile: ten times finer than any measurement"""
SAME_NOMINAL = 1e-3
"""Relative difference below which two nominal values count as equal, because files round them"""
MIN_SIGN_CONFIDENCE = 0.9
"""Confidence of the integrity check above which an encoder's sign is changed. Chosen."""


@dataclass(frozen=True)
class Calibration:
    """The measured values for a rig's profile, read from the file ``source``."""

    source: str
    base: Mapping[str, Measured]
    """Name in `BASE` → measured value; empty if the file has none"""
    keys: Mapping[str, Measured] = field(default_factory=dict)
    """Key of the profile → measured value (`profile_keys`)"""
    rest_deg: Mapping[str, float] = field(default_factory=dict)
    """Axis → angle in degrees to add to the rest angle"""
    counts: Mapping[str, float] = field(default_factory=dict)
    """Axis → factor for the encoder's counts per revolution; −1 if the sign is wrong"""
    left_out: tuple[str, ...] = ()
    """Causes without a key in the profile, and confounded causes"""
    profile: Profile | None = None
    """The profile of the measurement; None if the file does not contain it"""


def read_calibration(path: Path) -> Calibration:
    """Return the calibration in a model file or in the output of ``diagnose --json``.

    Raises UsageError if there is no such file, RecordingError if it contains no calibration.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise no_file(path) from None
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise _no_calibration(path, "is not JSON") from error
    schema = str(data.get("schema", "")) if isinstance(data, dict) else ""
    if schema.startswith("heli3dof.diagnosis/"):
        calibration = _from_diagnosis(path, data)
    elif schema.startswith("heli3dof.model/"):
        calibration = _from_model(path)
    else:
        raise _no_calibration(path, "is neither a model file nor a diagnosis")
    if not calibration.base and not calibration.counts and not calibration.rest_deg:
        raise _no_calibration(
            path, "contains no calibration (a diagnosis of a faulty recording has none)"
        )
    return calibration


def _no_calibration(path: Path, what: str) -> RecordingError:
    recording = path if path.suffix in (".mcap", ".csv", ".mat") else "REC.mcap"
    return RecordingError(
        f"{path} {what}.",
        cause="profile update reads the output of heli3dof diagnose, or a grey-box model file.",
        fix=f"heli3dof diagnose {quoted(recording)} -o model.json; heli3dof profile update --from "
        "model.json --profile rig.toml -o rig2.toml",
    )


def _from_diagnosis(path: Path, data: Mapping[str, Any]) -> Calibration:
    base = {
        str(c["parameter"]): Measured(float(c["nominal"]), float(c["value"]), float(c["std"]))
        for c in data.get("calibration", ())
        if c["parameter"] in BASE
    }
    keys = {
        str(p["key"]): Measured(float(p["was"]), float(p["value"]), float(p["std"]))
        for p in data.get("profile", ())
    }
    rest: dict[str, float] = {}
    counts: dict[str, float] = {}
    left_out: list[str] = []
    for f in data.get("findings", ()):
        effect, axis = str(f["effect"]), f.get("axis")
        name = effect if axis is None else f"{effect}.{axis}"
        if effect in ("motor.thrust_gain", "mass.imbalance", "inertia"):
            continue  # its value is in ``calibration``
        if f.get("tied_with"):
            left_out.append(f"{name} (confounded with {', '.join(f['tied_with'])})")
        elif effect == "encoder.offset":
            rest[axis] = -float(f["parameters"]["angle_deg"]["value"])
        elif effect == "encoder.scale":
            counts[axis] = float(f["parameters"]["scale"]["value"])
        else:
            left_out.append(name)
    for f in data.get("integrity", ()):
        if f.get("check") == "encoder.sign" and f.get("confidence", 0.0) >= MIN_SIGN_CONFIDENCE:
            counts[f["axis"]] = -counts.get(f["axis"], 1.0)
    return Calibration(path.name, base, keys, rest, counts, tuple(left_out))


def _from_model(path: Path) -> Calibration:
    from heli3dof.model.greybox.model import GreyBoxModel
    from heli3dof.model.model_file import read_model

    model = read_model(path)
    if not isinstance(model, GreyBoxModel):
        raise RecordingError(
            f"{path} contains a {model.kind} model, which has no physical parameters.",
            cause="a black-box model has no masses, thrust gain or inertias.",
            fix="heli3dof identify REC.mcap --method greybox -o model.json",
        )
    free = model.structure.free[:4]
    std = np.where(np.isfinite(model.std[:4]), model.std[:4], 0.0)
    scale = thrust_scale(model)
    K_f = model.profile.motor.K_f
    base = {"K_f": Measured(K_f, K_f * scale.k, K_f * scale.k * scale.std)}
    for f, v, s in zip(free, model.values, std, strict=False):
        assert any(u in f.unit for u in TORQUE_UNITS)
        base[f.name] = Measured(f.start, *scale.to_si(float(v), float(s), f.unit))
    keys = profile_keys(base, model.profile, level_hover(model))
    return Calibration(path.name, base, keys, left_out=tuple(model.terms), profile=model.profile)


def check_same_rig(calibration: Calibration, profile: Profile, file: str) -> None:
    """Raise UsageError if the calibration was computed with another profile than ``profile``.

    ``file``: name of the file of ``profile``, for the message.
    """
    values = profile.motor.K_f, profile.trim_torque, *profile.inertias
    nominal = dict(zip(BASE, values, strict=True))
    for name, m in calibration.base.items():
        if abs(m.nominal - nominal[name]) > SAME_NOMINAL * max(abs(nominal[name]), abs(m.nominal)):
            raise UsageError(
                f"{calibration.source} was measured against another profile: its nominal {name} is "
                f"{m.nominal:.5g}, that of {file} {nominal[name]:.5g}.",
                cause="the recordings were flown with another profile, or it was changed since.",
                fix="name the profile of the recordings with --profile",
            )


def changes(calibration: Calibration, profile: Profile) -> list[Change]:
    """Return the changes of the profile: key, old and new value, and source of the new value."""
    out = [_change(calibration, key, m) for key, m in calibration.keys.items()]
    for axis, factor in calibration.counts.items():
        before = getattr(profile.encoder, axis)
        source = _source_comment(calibration, before)
        out.append(Change(f"encoder.{axis}", round(before * factor), before, source))
    for axis, added in calibration.rest_deg.items():
        before = getattr(profile.encoder, f"{axis}_rest_deg")
        source = _source_comment(calibration, before)
        out.append(Change(f"encoder.{axis}_rest_deg", round(before + added, 3), before, source))
    return out


def profile_keys(
    base: Mapping[str, Measured], profile: Profile, hover: LevelHover | None
) -> dict[str, Measured]:
    """Return {key of the profile: measured value} for motor.K_f, motor.V_o and the inertias.

    ``base``: name in `BASE` → measured value. If it is empty, so is the result. ``hover``: voltage
    and thrust per volt of the model in level hover, computed with the K_f of ``profile``. If it is
    None, K_f and V_o are left out.
    """
    if not base:
        return {}
    out: dict[str, Measured] = {}
    if hover is not None:
        motor, K_f = profile.motor, base["K_f"]
        secant = hover.thrust_N_per_V / motor.K_f
        out["motor.K_f"] = Measured(motor.K_f, secant * K_f.value, secant * K_f.std)
        out["motor.V_o"] = Measured(motor.V_o, hover.voltage_V, hover.std_V)
    for axis, nominal in zip(AXES, profile.inertias, strict=True):
        J = base[f"J_{axis}"]
        out[f"inertia.{axis}"] = Measured(nominal, J.value, J.std)
    return out


def ratios(
    base: Mapping[str, Measured], profile: Profile, hover: LevelHover | None
) -> dict[str, Measured]:
    """Return the hover voltage ``V_o`` (V) and the ratios ``K_f/J_<axis>`` (N/(V·kg·m²)).

    Flights do not identify the thrust gain K_f. If the K_f of a fit is wrong by a factor, all
    fitted inertias J are wrong by the same factor, so K_f/J is correct. V_o is the voltage of level
    hover; it is left out if ``hover`` is None. `profile_keys` explains the arguments. If ``base``
    is empty, the result is empty, too.
    """
    if not base:
        return {}
    keys = profile_keys(base, profile, hover)
    out = {"V_o": keys["motor.V_o"]} if hover is not None else {}
    K_f = base["K_f"]
    for axis in AXES:
        J = base[f"J_{axis}"]
        value = K_f.value / J.value
        variance = max((J.std / J.value) ** 2 - (K_f.std / K_f.value) ** 2, 0.0)
        out[f"K_f/J_{axis}"] = Measured(K_f.nominal / J.nominal, value, abs(value) * sqrt(variance))
    return out


def ratio_unit(name: str) -> str:
    """Return the unit of the quantity ``name``, a key of the dict that `ratios` returns."""
    return "V" if name == "V_o" else "N/(V·kg·m²)"


def _change(calibration: Calibration, key: str, m: Measured) -> Change:
    spread = f"± {m.std:.2g}, " if isfinite(m.std) and m.std > 0 else ""
    rounded = float(f"{m.value:.{DIGITS}g}")
    return Change(key, rounded, m.nominal, spread + _source_comment(calibration, m.nominal))


def _source_comment(calibration: Calibration, before: float) -> str:
    return f"from {calibration.source}; was {before:.5g}"


def applied(profile: Profile, new: Sequence[Change]) -> dict[str, Any]:
    """Return the profile as nested dicts, with the changes ``new`` made."""
    from heli3dof.rig.profile_file import put

    data = profile.to_dict()
    for change in new:
        put(data, change.key, change.value)
    return data
