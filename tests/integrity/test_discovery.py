"""A file of checks that states none is refused, instead of being ignored."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from heli3dof.errors import Heli3dofError
from heli3dof.integrity import checks


@pytest.mark.parametrize("code", ["CHEKS = ()", "CHECKS = 3", "CHECKS = (3,)"])
def test_a_file_without_checks_is_refused(
    code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = sys.modules["heli3dof.integrity"]
    (tmp_path / "local_check.py").write_text(code, encoding="utf-8")
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])
    monkeypatch.delitem(sys.modules, "heli3dof.integrity.local_check", raising=False)
    importlib.invalidate_caches()
    checks.cache_clear()
    with pytest.raises(Heli3dofError, match=r"local_check\.py states no checks that can run"):
        checks()
    sys.modules.pop("heli3dof.integrity.local_check")
