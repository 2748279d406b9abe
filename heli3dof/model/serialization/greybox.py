"""Read model files of the form ``greybox`` into a `GreyBoxModel`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from heli3dof.errors import ProfileError, UsageError
from heli3dof.model.effects import PlugIn, broken, term
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.rig.profile import profile_from_dict


def from_dict(data: Mapping[str, Any]) -> GreyBoxModel:
    """Return the model from the output of `GreyBoxModel.to_dict`.

    Raises KeyError for a missing key, TypeError or ValueError for invalid content, and UsageError
    for an unknown effect. The message names the plug-in that provided the effect when the file was
    written.
    """
    names = tuple(str(t) for t in data["terms"])
    _check_terms(names, data.get("plug_ins", {}))
    try:
        profile = profile_from_dict(data["profile"], source="the model's profile", recorded=True)
    except ProfileError as error:
        raise ValueError(error.what) from error
    values = np.array([p["value"] for p in data["parameters"]], dtype=float)
    n = len(values)
    model = GreyBoxModel(
        name=str(data["name"]),
        kind=str(data["kind"]),
        profile=profile,
        terms=names,
        values=values,
        noise=np.array(data["acceleration_noise_rad_per_s2_per_sqrtHz"], dtype=float),
        covariance=np.array(data["covariance"], dtype=float).reshape(n, n),
        jitter_s=float(data.get("timing_jitter_s", 0.0)),
        varying={str(k): float(v) for k, v in data.get("varying_by_recording", {}).items()},
        extra=dict(data.get("extra", {})),
    )
    expected = model.structure.names
    given = tuple(p["name"] for p in data["parameters"])
    if given != expected:
        raise ValueError(
            f"its parameters are {', '.join(given)}, its terms ask for {', '.join(expected)}"
        )
    if unknown := set(model.varying) - set(expected):
        raise ValueError(f"varying_by_recording names {', '.join(sorted(unknown))}: no parameter")
    if model.noise.shape != (3,) or not np.isfinite(model.values).all():
        raise ValueError("a parameter or the noise holds null where a number belongs")
    return model


def _check_terms(names: Sequence[str], written_with: Mapping[str, Any]) -> None:
    """Raise UsageError if an effect in ``names`` is not installed.

    ``written_with`` is {effect: plug-in} from the model file.
    """
    for name in names:
        try:
            term(name)
        except UsageError as error:
            for effect, about in written_with.items():
                if name in (effect, f"{effect}.{name.rpartition('.')[2]}"):
                    plug_in = PlugIn(**about)
                    raise UsageError(
                        f"Its effect {name!r} is of {plug_in}, which does not load here.",
                        cause=error.cause if broken() else "the package is not installed here.",
                        fix=plug_in.install,
                    ) from error
            raise
