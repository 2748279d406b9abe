"""Models that share a name get distinct labels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from heli3dof.model.greybox.model import nominal
from heli3dof.model.labels import labels
from heli3dof.model.linear.hover import hover_model
from heli3dof.model.model_file import read_model, save_model
from heli3dof.rig.profile import default_profile

PROFILE = default_profile()


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        (["a", None], ["hover", "a", "grey"]),
        (["a", "b"], ["hover", "a", "b"]),
        ([None, None], ["hover", "grey", "grey (2)"]),
        (["x/a", "y/a"], ["hover", "grey", "grey (2)"]),
        (["hover", "b"], ["hover", "grey", "b"]),
        (["grey", None], ["hover", "grey", "grey (2)"]),
    ],
)
def test_labels_are_names_then_stems_then_numbers(
    files: list[str | None], expected: list[str], tmp_path: Path
) -> None:
    grey = replace(nominal(PROFILE), name="grey")
    models = [hover_model(PROFILE)]
    for file in files:
        path = tmp_path / f"{file}.json"
        path.parent.mkdir(exist_ok=True)
        models.append(grey if file is None else read_model(save_model(grey, path)))
    assert labels(models) == expected


def test_a_unique_name_is_the_label_whatever_the_file(tmp_path: Path) -> None:
    model = read_model(save_model(nominal(PROFILE), tmp_path / "other.json"))
    assert labels([model, hover_model(PROFILE)]) == ["rigid-body", "hover"]
