"""The paper's models by name, made from a rig's profile: ``--model hover`` and its relatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from heli3dof.errors import UsageError, did_you_mean
from heli3dof.model.base import Model
from heli3dof.model.model_file import read_model
from heli3dof.rig.profile import Profile, default_profile


def _hover(profile: Profile) -> Model:
    from heli3dof.model.linear.hover import hover_model

    return hover_model(profile)


def _hover_printed(profile: Profile) -> Model:
    from heli3dof.model.linear.hover import hover_model

    return hover_model(profile, printed=True)


def _paper_17(profile: Profile) -> Model:
    from heli3dof.paper.eq17 import paper17_model

    return paper17_model(profile)


def _paper_17_mended(profile: Profile) -> Model:
    from heli3dof.paper.eq17 import paper17_model

    return paper17_model(profile, mended=True)


BUILT_IN: Mapping[str, Callable[[Profile], Model]] = {
    "hover": _hover,
    "hover-printed": _hover_printed,
    "paper-17": _paper_17,
    "paper-17-mended": _paper_17_mended,
}
"""The models that come with the tool, by the name to give to ``--model``."""


def load_model(name_or_path: str | Path, profile: Profile | None = None) -> Model:
    """The model in a file, or a built-in one for this rig (default: the profile that ships).

    Raises UsageError for a name that is neither, naming the nearest, and RecordingError for a
    file that is missing or no usable model file.
    """
    text = str(name_or_path)
    if text in BUILT_IN:
        return BUILT_IN[text](default_profile() if profile is None else profile)
    path = Path(name_or_path)
    if not path.exists() and path.suffix == "" and len(path.parts) == 1:
        raise UsageError(
            f"There is no model {text!r}.",
            cause=f"a typing error; {did_you_mean(text, BUILT_IN)}",
            fix=f"--model with one of {', '.join(BUILT_IN)}, or the path of a model file (.json)",
        )
    return read_model(path)
