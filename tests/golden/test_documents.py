"""What scripts read stays as it is: every key, number and word of the printed documents."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.golden.commands import COMMANDS, KEPT, differences, documents

SHARE = 1e-2
"""of a number: what a limit cycle on one count makes of another processor's last bit"""


@pytest.mark.parametrize("name", COMMANDS)
def test_a_document_is_what_it_was(name: str, tmp_path: Path) -> None:
    for file, now in documents([name], tmp_path):
        kept = json.loads((KEPT / file).read_text(encoding="utf-8"))
        assert list(differences(kept, now, SHARE)) == []
