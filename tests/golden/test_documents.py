"""Checks that the JSON documents for scripts are unchanged: every key, number and word.

Of a diagnosis, only the keys and the kinds of values are compared, because its numbers depend on
the processor; ``python -m tests.golden`` compares them before and after a change on one machine.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.golden.commands import COMMANDS, DIAGNOSES, KEPT, differences, documents, form

SHARE = 1e-2
"""Allowed difference: a limit cycle on one encoder count amplifies rounding to this size"""


@pytest.mark.parametrize("name", COMMANDS)
def test_a_document_is_unchanged(name: str, tmp_path: Path) -> None:
    for file, now in documents([name], tmp_path):
        kept = json.loads((KEPT / file).read_text(encoding="utf-8"))
        if name in DIAGNOSES:
            kept, now = form(kept), form(now)
        assert list(differences(kept, now, SHARE)) == []


def test_a_missing_key_and_another_kind_of_value_change_the_form() -> None:
    kept = {"score": 49.7, "tied_with": ["a"]}
    assert form({"score": 42.0, "tied_with": ["b", "c"]}) == form(kept)
    assert form({"score": "42.0", "tied_with": ["b"]}) != form(kept)
    assert form({"score": 42.0}) != form(kept)
