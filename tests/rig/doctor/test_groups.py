"""A check of ``heli3dof doctor`` is found by being in a file of the folder."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from heli3dof.errors import Heli3dofError
from heli3dof.rig import doctor
from heli3dof.rig.doctor import folder, host, link

NEW = """
from heli3dof.rig.doctor import RECORDINGS, verdict


def local(folder):
    return verdict("local folder", f"{folder} is local", True, "")


GROUP = RECORDINGS
CHECKS = (local,)
"""


@pytest.fixture
def added(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Callable[[str], None]]:
    """Adds a file to the folder."""

    def write(text: str) -> None:
        (tmp_path / "local_folder.py").write_text(text)
        monkeypatch.setattr(doctor, "__path__", [*doctor.__path__, str(tmp_path)])
        importlib.invalidate_caches()

    yield write
    sys.modules.pop("heli3dof.rig.doctor.local_folder", None)


def test_the_checks_of_a_group_are_those_of_its_files() -> None:
    assert set(host.CHECKS) <= set(doctor.checks_of("computer"))
    assert set(link.CHECKS) <= set(doctor.checks_of("rig"))
    assert not set(link.CHECKS) & set(doctor.checks_of("computer"))


def test_a_new_file_is_a_new_check(added: Callable[[str], None], tmp_path: Path) -> None:
    added(NEW)
    assert "local folder" in [check.what for check in folder.checks(tmp_path)]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("GROUP = RECORDINGS", "", "GROUP is None"),
        ("GROUP = RECORDINGS", "GROUP = 'recording'", "GROUP is 'recording'"),
        ("CHECKS =", "TESTS =", "local_folder.py states no checks"),
    ],
)
def test_a_file_without_group_or_checks_is_an_error_that_names_it(
    old: str, new: str, says: str, added: Callable[[str], None], tmp_path: Path
) -> None:
    added(NEW.replace(old, new))
    with pytest.raises(Heli3dofError, match="local_folder") as caught:
        list(folder.checks(tmp_path))
    assert says in caught.value.what
    assert "recordings" in caught.value.cause
