"""Which causes are adopted for what they gain on data not seen."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from heli3dof.diagnosis.gain import Interval
from heli3dof.diagnosis.measured import is_worth


@pytest.mark.parametrize(
    ("low", "value", "first", "weak", "adopted"),
    [
        (2.0, 20.0, False, False, True),  # surely likelier
        (-1.0, 20.0, False, False, False),  # not surely
        (-1.0, 20.0, True, False, True),  # odds of e²⁰ do for a first one,
        (-1.0, 20.0, False, True, True),  # and for one that is told as "…-like" only
        (-1.0, 2.0, False, True, False),  # e² do not: 7 to one
    ],
)
def test_a_cause_is_adopted_where_data_not_seen_confirm_it(
    low: float, value: float, first: bool, weak: bool, adopted: bool
) -> None:
    gain = cast(Any, SimpleNamespace(log_likelihood=Interval(value, low, 2 * value)))
    choice = cast(Any, SimpleNamespace(weak=weak))
    assert is_worth(choice, gain, first=first) is adopted
