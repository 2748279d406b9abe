"""Load a model by name or path: one of the paper's models, or a model file."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from pathlib import Path

from heli3dof.errors import UsageError, did_you_mean
from heli3dof.model.base import Model
from heli3dof.model.model_file import read_model
from heli3dof.rig.profile import Profile, default_profile


def _hover(profile: Profile, *, printed: bool = False) -> Model:
    from heli3dof.model.linear.hover import hover_model

    return hover_model(profile, printed=printed)


def _paper_17(profile: Profile, *, corrected: bool = False) -> Model:
    from heli3dof.paper.eq17 import paper17_model

    return paper17_model(profile, corrected=corrected)


BUILT_IN: Mapping[str, Callable[[Profile], Model]] = {
    "hover": _hover,
    "hover-printed": lambda profile: _hover(profile, printed=True),
    "paper-17": _paper_17,
    "paper-17-corrected": lambda profile: _paper_17(profile, corrected=True),
}
"""Name for ``--model`` → function that makes the built-in model for a profile."""

OLD_NAMES = {"paper-17-mended": "paper-17-corrected"}
"""Model name of an earlier version → its present name; the old one gives a warning."""


def load_model(name_or_path: str | Path, profile: Profile | None = None) -> Model:
    """Return a built-in model for a rig's profile, or the model in a file.

    ``profile``: the rig's profile for a built-in model, by default that of the paper's rig. Raises
    UsageError for an unknown name, RecordingError for a missing or unusable file.
    """
    text = str(name_or_path)
    if text in OLD_NAMES:
        logging.getLogger("heli3dof").warning(
            "Warning: the model %s is now called %s; the old name will be removed.",
            text, OLD_NAMES[text],
        )  # fmt: skip
        text = OLD_NAMES[text]
    if text in BUILT_IN:
        return BUILT_IN[text](default_profile() if profile is None else profile)
    path = Path(name_or_path)
    if not path.exists() and path.suffix == "" and len(path.parts) == 1:
        raise UsageError(
            f"There is no model {text!r}.",
            cause=f"a typing error; {did_you_mean(text, BUILT_IN)}",
            fix=f"one of {', '.join(BUILT_IN)}, or the path of a model file (.json)",
        )
    return read_model(path)
