"""The report's section on models shows a grey box like a linear model, and its parameters."""

from __future__ import annotations

import numpy as np

from heli3dof.model.greybox.model import nominal
from heli3dof.model.linear.hover import hover_model
from heli3dof.report.pages.model_section import (
    LOWEST,
    bode_of,
    linearised,
    model_blocks,
    parameters_of,
)
from heli3dof.rig.profile import default_profile
from tests.comparison.fakes import FakeHover

PROFILE = default_profile()
LAGGING = nominal(PROFILE, ("motor.lag",), **{"motor.lag.time_constant_s": 0.1})


def test_the_linearised_rigid_body_is_the_hover_model_and_a_lag() -> None:
    hover, lagging = hover_model(PROFILE), linearised(LAGGING)
    assert lagging is not None
    _, curves = bode_of([hover, lagging])
    for first, second in curves.values():
        ratio = second.response[0] / first.response[0]
        assert np.isclose(ratio, 1 / (1 + 0.1j * LOWEST), rtol=1e-3)


def test_the_parameters_have_their_units_and_nominal_values() -> None:
    rows = {row[0]: row for row in parameters_of(LAGGING).rows}
    assert rows["motor.lag.time_constant_s"][1:] == ["0.1", "–", "0", "s"]
    assert rows["J_yaw"][4] == "kg·m²"


def test_the_section_has_parameters_and_bode_diagrams_of_a_grey_box() -> None:
    text = "".join(model_blocks([LAGGING], PROFILE))
    assert "Parameters of rigid-body" in text
    assert "<figure" in text


def test_models_of_one_name_have_the_labels_of_the_comparison() -> None:
    text = "".join(model_blocks([LAGGING, nominal(PROFILE)], PROFILE))
    for label in ("rigid-body", "rigid-body (2)"):
        assert f"Parameters of {label}<" in text
        assert text.count(f">{label}<") >= 1


def test_a_model_of_another_kind_has_no_bode_diagram() -> None:
    assert linearised(FakeHover()) is None
