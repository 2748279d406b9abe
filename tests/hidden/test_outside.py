from __future__ import annotations

import pytest

from heli3dof.diagnosis.unmodelled.torque_formula import PRODUCTS as LIBRARY
from tests.hidden.outside import PRODUCTS, proposes_true_formula, share_of_true_gain
from tests.hidden.sizes import OUTSIDE
from tests.hidden.tally import Judged
from tests.hidden.third_plant.effects import OUTSIDE as THIRD_OUTSIDE

NAME = "other.yaw_torque_from_pitch_rate"


def diagnosed(after_deg: float | None) -> dict[str, object]:
    return {"gain": {"holdout_rmse_deg": {"after": {"yaw": after_deg}}}}


TRUE = {"before": {"yaw": 5.0}, "after": {"yaw": 1.0}}


@pytest.mark.parametrize(
    ("after_deg", "share"),
    [(1.0, 1.0), (0.9, 1.0), (2.0, 0.75), (5.0, 0.0), (6.0, 0.0), (None, 0.0)],
)
def test_the_share_is_of_the_decrease_that_the_true_term_brings(
    after_deg: float | None, share: float
) -> None:
    assert share_of_true_gain(NAME, diagnosed(after_deg), TRUE) == pytest.approx(share)


@pytest.mark.parametrize(
    ("axis", "formula", "right"),
    [
        ("yaw", "c * pitch_rate", True),
        ("roll", "c * pitch_rate", False),
        ("yaw", "c * yaw_rate", False),
        ("yaw", None, False),
    ],
)
def test_a_formula_is_right_on_its_axis_only(axis: str, formula: str | None, right: bool) -> None:
    truth = {"names": [NAME], "unseen": ["timing.jitter"]}
    document = {"leftover": [{"axis": axis, "formula": formula}]}
    assert proposes_true_formula(Judged({"truth": truth, "document": document}, None)) == right


def test_the_library_contains_every_true_term() -> None:
    assert set(PRODUCTS) == {*OUTSIDE, *THIRD_OUTSIDE}
    assert set(PRODUCTS.values()) <= set(LIBRARY)
