"""The condition of --where."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from heli3dof.batch.condition import checked, holds
from heli3dof.batch.recording_columns import COLUMNS
from heli3dof.errors import UsageError

ROW = {"rig": "K1", "plan": "rich", "duration_s": 63.0, "late_share": None}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('rig="K1"', True),
        ('rig == "K1" and plan="steps"', False),
        ('rig="K2" or duration_s > 60', True),
        ('not plan="rich"', False),
        ('"ri" in plan', True),
        ('rig in ("K1", "K2") and plan not in ["steps"]', True),
        ('rig in ("K10", "K2")', False),
        ("duration_s in (62, -63)", False),
        ("duration_s >= 63 and duration_s <= 63", True),
        ("duration_s != 63", False),
        ("late_share < 0.1", False),
        ("(late_share < 0.1 or rig='K1') and duration_s > -1", True),
    ],
)
def test_a_condition_holds_as_written(text: str, expected: bool) -> None:
    assert holds(checked(text, COLUMNS), ROW) is expected


@given(st.text(alphabet="abc =<>'", max_size=8))
def test_a_text_in_quotes_is_compared_as_it_is(name: str) -> None:
    assert holds(checked(f"rig={name!r}", COLUMNS), {"rig": name})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('rigg="K1"', "did you mean 'rig'"),
        ("rig=K1", "a text stands in quotes"),
        ('rig="K1', "not a complete condition"),
        ("", "not a complete condition"),
        ("rig=", "not a complete condition"),
        ("__import__('os').system('ls')", "is not allowed"),
        ("[x for x in rig]", "is not allowed"),
        ("rig.upper() = 'K1'", "is not allowed"),
        ('rig in "K10"', "'in' is followed by a list"),
        ('rig = ("K1", "K2")', "'in' is followed by a list"),
        ('rig = "K1", "K2"', "a list stands only after 'in'"),
        ("duration_s > '30'", "compares a number with a text"),
        ("started_utc > 2026", "compares a number with a text"),
        ('rig in ("K1", 2)', "compares a number with a text"),
    ],
)
def test_a_faulty_condition_is_explained(text: str, message: str) -> None:
    with pytest.raises(UsageError) as error:
        checked(text, COLUMNS)
    assert message in str(error.value)
