"""The checks of the folder of recordings."""

from __future__ import annotations

from collections import namedtuple
from pathlib import Path

from heli3dof.rig.doctor import folder

Usage = namedtuple("Usage", "total used free")


def test_a_missing_folder_is_judged_by_its_parent(tmp_path: Path):
    result = list(folder.checks(tmp_path / "not" / "made"))
    assert str(tmp_path) in result[0].found
    assert not (tmp_path / "not").exists()
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_reported(monkeypatch, tmp_path):
    monkeypatch.setattr(folder.shutil, "disk_usage", lambda _: Usage(10**12, 10**12, 10**8))
    check = folder.free_space(tmp_path)
    assert check.good is False
    assert "0.1 GB free" in check.found


def test_a_slow_disk_is_reported(monkeypatch, tmp_path):
    monkeypatch.setattr(folder, "_once", lambda _: 0.5)
    check = folder.write_time(tmp_path)
    assert check.good is False
    assert "500.0 ms at the median" in check.found


def test_an_unwritable_folder_is_reported(monkeypatch, tmp_path):
    def refused(**_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(folder.tempfile, "TemporaryFile", refused)
    check = folder.write_time(tmp_path)
    assert check.good is False
    assert "permission denied" in check.found
