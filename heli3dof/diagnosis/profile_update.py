"""What a diagnosis or a grey box measured, as keys of a profile.

    K_f                    motor.K_f
    T_g/(2 L_a K_f)        motor.V_o           L_a is the profile's: a tape measure beats a flight
    J_roll, J_pitch, J_yaw inertia.roll, .pitch, .yaw
    encoder.offset         encoder.<axis>_rest_deg − offset     reading = angle + offset
    encoder.scale          encoder.<axis> · k                   reading = rest + k (angle − rest)
    encoder.sign           −encoder.<axis>                      (from the integrity checks)

T_g and the inertias of a model file are in units of its profile's K_f; `thrust_scale` gives them,
and K_f, in SI, as ``diagnose --json`` does. V_o = T_g/(2 L_a K_f) does not depend on that scale.
Causes that no key holds (friction, lag, …) stay in the model file and are listed.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.estimate.thrust_scale import TORQUE_UNITS, of_ratios
from heli3dof.errors import RecordingError, UsageError
from heli3dof.rig.profile import Profile
from heli3dof.rig.profile_file import Change

DIGITS = 5
"""Significant digits of a number written into a profile: ten times finer than any is measured."""
SAME = 1e-3
"""Relative difference up to which a nominal value is the profile's: digits lost on the way."""
CERTAIN = 0.9
"""Confidence from which an encoder's sign is changed."""
BASE = ("K_f", "T_g", "J_roll", "J_pitch", "J_yaw")


@dataclass(frozen=True)
class Measured:
    """A base parameter in SI: what the profile said, what was found, its standard deviation."""

    nominal: float
    value: float
    std: float


@dataclass(frozen=True)
class Calibration:
    """What a file says of a rig's numbers."""

    source: str
    base: Mapping[str, Measured]
    rest_deg: Mapping[str, float] = field(default_factory=dict)
    """axis → ° to add to the rest angle"""
    counts: Mapping[str, float] = field(default_factory=dict)
    """axis → factor of the counts per revolution, −1 where the sign is wrong"""
    left_out: tuple[str, ...] = ()
    """Causes that no key of a profile holds"""
    profile: Profile | None = None
    """The profile that it was measured with, where the file has it"""


def read_calibration(path: Path) -> Calibration:
    """From a model file or from what ``diagnose --json`` printed.

    Raises RecordingError for any other file, and for one that holds no calibration.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UsageError(
            f"There is no file {path}.",
            cause="a typing error in the path, or another working directory.",
            fix=f"ls {path.parent}",
        ) from None
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise _none_in(path, "is not JSON") from error
    schema = str(data.get("schema", "")) if isinstance(data, dict) else ""
    if schema.startswith("heli3dof.diagnosis/"):
        found = _of_diagnosis(path, data)
    elif schema.startswith("heli3dof.model/"):
        found = _of_model(path)
    else:
        raise _none_in(path, "is neither a model file nor a diagnosis")
    if not found.base and not found.counts and not found.rest_deg:
        raise _none_in(path, "contains no calibration (a diagnosis of a faulty recording has none)")
    return found


def _none_in(path: Path, what: str) -> RecordingError:
    recording = path if path.suffix in (".mcap", ".csv", ".mat") else "REC.mcap"
    return RecordingError(
        f"{path} {what}.",
        cause="profile update reads the output of heli3dof diagnose, or a grey-box model file.",
        fix=f"heli3dof diagnose {recording} -o model.json; heli3dof profile update --from "
        "model.json --profile rig.toml -o rig2.toml",
    )


def _of_diagnosis(path: Path, data: Mapping[str, Any]) -> Calibration:
    base = {
        str(c["parameter"]): Measured(float(c["nominal"]), float(c["value"]), float(c["std"]))
        for c in data.get("calibration", ())
        if c["parameter"] in BASE
    }
    rest: dict[str, float] = {}
    counts: dict[str, float] = {}
    left: list[str] = []
    for f in data.get("findings", ()):
        effect, axis = str(f["effect"]), f.get("axis")
        name = effect if axis is None else f"{effect}.{axis}"
        if f.get("tied_with"):
            left.append(f"{name} (confounded with {', '.join(f['tied_with'])})")
        elif effect == "encoder.offset":
            rest[axis] = -float(f["parameters"]["angle_deg"]["value"])
        elif effect == "encoder.scale":
            counts[axis] = float(f["parameters"]["scale"]["value"])
        elif effect not in ("motor.thrust_gain", "mass.imbalance", "inertia"):
            left.append(name)
    for f in data.get("integrity", ()):
        if f.get("check") == "encoder.sign" and f.get("confidence", 0.0) >= CERTAIN:
            counts[f["axis"]] = -1.0
    return Calibration(path.name, base, rest, counts, tuple(left))


def _of_model(path: Path) -> Calibration:
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
    nominal = np.array([f.start for f in free])
    std = np.where(np.isfinite(model.std[:4]), model.std[:4], 0.0)
    scale = of_ratios(
        model.values[:4] / nominal, std / np.abs(nominal), 0.5 * model.profile.tolerance
    )
    K_f = model.profile.motor.K_f
    base = {"K_f": Measured(K_f, K_f * scale.k, K_f * scale.k * scale.std)}
    for f, v, s in zip(free, model.values, std, strict=False):
        assert any(u in f.unit for u in TORQUE_UNITS)
        base[f.name] = Measured(f.start, *scale.applied(float(v), float(s), f.unit))
    return Calibration(path.name, base, left_out=tuple(model.terms), profile=model.profile)


def check_same_rig(found: Calibration, profile: Profile, file: str) -> None:
    """Raise UsageError where the calibration was measured against another profile."""
    J = dict(zip(AXES, profile.inertias, strict=True))
    own = {"K_f": profile.motor.K_f, "T_g": profile.trim_torque}
    own |= {f"J_{axis}": J[axis] for axis in AXES}
    for name, m in found.base.items():
        if abs(m.nominal - own[name]) > SAME * max(abs(own[name]), abs(m.nominal)):
            raise UsageError(
                f"{found.source} was measured against another profile: its nominal {name} is "
                f"{m.nominal:.5g}, that of {file} {own[name]:.5g}.",
                cause="the recordings were flown with another profile, or it was changed since.",
                fix="name the profile of the recordings with --profile",
            )


def changes(found: Calibration, profile: Profile) -> list[Change]:
    """The keys to change, with where each number comes from."""
    return [*_base(found, profile), *_encoders(found, profile)]


def _base(found: Calibration, profile: Profile) -> Iterator[Change]:
    for key, m in profile_keys(found.base, profile).items():
        yield _change(found, key, m.value, m.nominal, m.std)


def profile_keys(base: Mapping[str, Measured], profile: Profile) -> dict[str, Measured]:
    """Return the base parameters by profile key: motor.K_f, motor.V_o and [inertia]; or nothing."""
    if not base:
        return {}
    K_f, T_g = base["K_f"], base["T_g"]
    V_o = T_g.value / (2 * profile.geometry.L_a * K_f.value)
    out = {
        "motor.K_f": Measured(profile.motor.K_f, K_f.value, K_f.std),
        "motor.V_o": Measured(profile.motor.V_o, V_o, abs(V_o) * _beside_scale(T_g, K_f)),
    }
    for axis, nominal in zip(AXES, profile.inertias, strict=True):
        J = base[f"J_{axis}"]
        out[f"inertia.{axis}"] = Measured(nominal, J.value, J.std)
    return out


def ratios(base: Mapping[str, Measured], profile: Profile) -> dict[str, Measured]:
    """Return what flights determine without a scale: V_o in V, and K_f/J in N/(V·kg·m²).

    The standard deviations of K_f, T_g and the inertias contain that of K_f, which only the
    profile's tolerance bounds. It cancels in these ratios.
    """
    if not base:
        return {}
    K_f, out = base["K_f"], {"V_o": profile_keys(base, profile)["motor.V_o"]}
    for axis in AXES:
        J = base[f"J_{axis}"]
        value = K_f.value / J.value
        spread = abs(value) * _beside_scale(J, K_f)
        out[f"K_f/J_{axis}"] = Measured(K_f.nominal / J.nominal, value, spread)
    return out


def _beside_scale(m: Measured, K_f: Measured) -> float:
    """Return the relative standard deviation of m/K_f: that of m without K_f's."""
    return sqrt(max(_share(m) ** 2 - _share(K_f) ** 2, 0.0))


def _share(m: Measured) -> float:
    return m.std / abs(m.value) if m.value else 0.0


def _encoders(found: Calibration, profile: Profile) -> Iterator[Change]:
    for axis, factor in found.counts.items():
        before = getattr(profile.encoder, axis)
        yield Change(f"encoder.{axis}", round(before * factor), before, _from(found, before))
    for axis, added in found.rest_deg.items():
        before = getattr(profile.encoder, f"{axis}_rest_deg")
        yield Change(
            f"encoder.{axis}_rest_deg", round(before + added, 3), before, _from(found, before)
        )


def _change(found: Calibration, key: str, value: float, before: float, std: float) -> Change:
    spread = f" ± {std:.2g}" if isfinite(std) and std > 0 else ""
    rounded = float(f"{value:.{DIGITS}g}")
    return Change(key, rounded, before, _from(found, before, spread))


def _from(found: Calibration, before: float, spread: str = "") -> str:
    return f"{spread.strip() + ', ' if spread else ''}from {found.source}; was {before:.5g}"


def applied(profile: Profile, made: Sequence[Change]) -> dict[str, Any]:
    """The profile's nested dict with the changes."""
    from heli3dof.rig.profile_file import put

    data = profile.to_dict()
    for change in made:
        put(data, change.key, change.value)
    return data
