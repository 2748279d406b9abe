"""Rules of the diagnosis that are noted or left out."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from heli3dof.diagnosis import diagnose
from heli3dof.diagnosis.conclusion import segments as nearly
from tests.hidden.rules import BY_NAME, RULES, noted, outline, replaced


def test_every_rule_is_a_function_of_the_diagnosis() -> None:
    assert len(BY_NAME) == len(RULES)
    assert all(callable(rule.function) for rule in RULES)


def test_a_function_is_replaced_wherever_it_was_imported() -> None:
    own = nearly.with_segment_ties

    def other(findings: object) -> object:
        return findings

    with replaced(own, other):
        assert nearly.with_segment_ties is other
        assert diagnose.with_segment_ties is other  # type: ignore[attr-defined]
    assert nearly.with_segment_ties is own
    assert diagnose.with_segment_ties is own  # type: ignore[attr-defined]


def test_a_rule_is_noted_if_its_outcome_differs_from_leaving_it_out() -> None:
    changed: set[str] = set()
    rule = BY_NAME["… and exceed one count"]
    function = rule.function
    with replaced(function, lambda *_: False):
        noted(rule, changed)(None, None)
    assert not changed
    with replaced(function, lambda *_: True):
        noted(rule, changed)(None, None)
    assert changed == {rule.name}


def test_a_rule_that_yields_alternatives_is_noted_at_the_first_one() -> None:
    changed: set[str] = set()
    rule = BY_NAME["alternatives of a cause that does not pay"]

    def two(*_: object) -> Iterator[int]:
        yield from (1, 2)

    with replaced(rule.function, two):
        items = noted(rule, changed)(None, None, None, set())
    assert not changed
    assert next(items) == 1
    assert changed == {rule.name}


@pytest.mark.parametrize(("x", "y"), [(1.0, 1.0 + 1e-9), ([1.0, 2.0], (1.0, 2.0))])
def test_outcomes_are_compared_to_six_digits(x: object, y: object) -> None:
    assert outline(x) == outline(y)
