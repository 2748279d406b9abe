"""Rules of the diagnosis that are noted or left out."""

from __future__ import annotations

import pytest

from heli3dof.diagnosis.conclusion import adoption, unknown_controller
from tests.hidden.rules import BY_NAME, RULES, noted, outline, replaced


def test_every_rule_is_a_function_of_the_diagnosis() -> None:
    assert len(BY_NAME) == len(RULES)
    assert all(callable(rule.function) for rule in RULES)


def test_a_function_is_replaced_wherever_it_was_imported() -> None:
    own = unknown_controller.exceeds_rounding

    def other(gain: object) -> bool:
        return True

    with replaced(own, other):
        assert unknown_controller.exceeds_rounding is other
        assert adoption.exceeds_rounding is other  # type: ignore[attr-defined]
    assert unknown_controller.exceeds_rounding is own
    assert adoption.exceeds_rounding is own  # type: ignore[attr-defined]


def test_a_rule_is_noted_if_its_outcome_differs_from_leaving_it_out() -> None:
    changed: set[str] = set()
    rule = BY_NAME["… and not act on an axis with a biased likelihood (controller unknown)"]
    function = rule.function
    with replaced(function, lambda *_: False):
        noted(rule, changed)(None, None)
    assert not changed
    with replaced(function, lambda *_: True):
        noted(rule, changed)(None, None)
    assert changed == {rule.name}


@pytest.mark.parametrize(("x", "y"), [(1.0, 1.0 + 1e-9), ([1.0, 2.0], (1.0, 2.0))])
def test_outcomes_are_compared_to_six_digits(x: object, y: object) -> None:
    assert outline(x) == outline(y)
