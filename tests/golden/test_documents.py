"""Checks that the JSON documents for scripts are unchanged: every key, number and word."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.golden.commands import COMMANDS, KEPT, differences, documents

SHARE = 1e-2
"""Allowed difference: a limit cycle on one encoder count amplifies rounding to this size"""


@pytest.mark.parametrize("name", COMMANDS)
def test_a_document_is_unchanged(name: str, tmp_path: Path) -> None:
    for file, now in documents([name], tmp_path):
        kept = json.loads((KEPT / file).read_text(encoding="utf-8"))
        assert list(differences(kept, now, SHARE)) == []
