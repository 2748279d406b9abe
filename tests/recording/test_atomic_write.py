"""New files."""

from __future__ import annotations

import errno
import os
import threading
from pathlib import Path

import pytest

import heli3dof as h3
from heli3dof.errors import NoSpace, OutputExists, UsageError
from heli3dof.recording.atomic_write import (
    check_ending,
    default_output,
    file_name,
    new_file,
    reserved,
    stem,
)
from tests.cli.running import heli3dof


@pytest.mark.parametrize(
    ("name", "plain"),
    [("cable.yaw:0.1.mcap", "cable.yaw:0.1"), ("log.CSV.gz", "log"), ("flight", "flight")],
)
def test_the_stem_keeps_the_dots_of_a_name(name: str, plain: str) -> None:
    assert stem(Path(name)) == plain


def test_a_file_appears_complete_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "a"
    with pytest.raises(ZeroDivisionError), new_file(path) as stream:  # noqa: PT012
        stream.write(b"half")
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []
    with new_file(path) as stream:
        stream.write(b"whole")
        assert not path.exists()
    assert path.read_bytes() == b"whole"


def test_a_file_created_meanwhile_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "a"
    with pytest.raises(OutputExists), new_file(path) as stream:  # noqa: PT012
        stream.write(b"ours")
        path.write_bytes(b"theirs")
    assert path.read_bytes() == b"theirs"
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_a_replacement_that_fails_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"old")
    with pytest.raises(NoSpace, match="no space left") as caught, new_file(path, force=True):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert caught.value.exit_code == 5
    assert path.read_bytes() == b"old"


def test_a_folder_is_not_a_file_and_a_missing_one_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is a folder"), new_file(tmp_path):
        pass
    with pytest.raises(UsageError, match="mkdir -p"), new_file(tmp_path / "b" / "a"):
        pass


def test_a_link_stays_a_link_and_a_pipe_stays_a_pipe(tmp_path: Path) -> None:
    target, link, pipe = (tmp_path / name for name in ("target", "link", "pipe"))
    target.write_bytes(b"old")
    link.symlink_to(target)
    with new_file(link, force=True) as stream:
        stream.write(b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"

    os.mkfifo(pipe)
    got: list[bytes] = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()))
    reader.start()
    with new_file(pipe, force=True) as stream:
        stream.write(b"rows")
    reader.join(10)
    assert pipe.is_fifo()
    assert got == [b"rows"]


def test_a_default_name_is_numbered_if_it_exists(tmp_path: Path) -> None:
    ours = tmp_path / "a-extended.json"
    assert default_output(ours, force=False) == ours
    ours.touch()
    assert default_output(ours, force=False).name == "a-extended-2.json"
    default_output(ours, force=False).touch()
    assert default_output(ours, force=False).name == "a-extended-3.json"
    assert default_output(ours, force=False, data=b"").name == "a-extended.json"
    assert default_output(ours, force=False, data=b"other").name == "a-extended-3.json"


def test_a_file_name_is_one_component_of_a_path() -> None:
    assert file_name("../..\\x\0y\n") == "..-..-x-y-"
    assert file_name("cable.yaw:0.1 ψ") == "cable.yaw:0.1 ψ"


def test_a_recording_or_model_is_not_written_under_another_formats_ending(tmp_path: Path) -> None:
    plan, model = h3.step_plan((5.0, None, None)), h3.hover_model(h3.default_profile())
    with pytest.raises(UsageError, match=r"heli3dof export o\.mcap; in Python the function export"):
        h3.fly_plan(plan, output=tmp_path / "o.csv")
    recording = h3.simulate(plan, model, start="level")
    for name in ("w.csv", "w.CSV.gz", "w.mat", "w.json", "w.parquet"):
        with pytest.raises(UsageError, match=r"would be a \.mcap file"):
            h3.write_recording(recording, tmp_path / name)
    for name in ("m.mat", "m.mcap"):
        with pytest.raises(UsageError, match=r"would be a \.json file"):
            h3.save_model(model, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "words",
    [
        ("report", "a.mcap", "-o", "r.pdf"),
        ("identify", "a.mcap", "--report", "r.svg"),
        ("diagnose", "a.mcap", "--report", "r.CSV"),
        ("fleet", ".", "-o", "r.png"),
    ],
)
def test_a_page_is_not_written_under_another_formats_ending(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = heli3dof(*words)
    assert result.code == 2
    assert "would be a .html file" in result.err
    assert "the name r.html" in result.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["a.mcap", "a.MCAP", "a", "step-1.5V", "/dev/stdout"])
def test_any_other_name_is_permitted(name: str) -> None:
    check_ending(Path(name), ".mcap")


def test_a_reserved_name_is_free_for_each_and_removed_if_empty(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with reserved(path) as first, reserved(path) as second, reserved(path) as third:
        assert [p.name for p in (first, second, third)] == ["a.mcap", "a-2.mcap", "a-3.mcap"]
        second.write_bytes(b"flight")
    assert [p.name for p in tmp_path.iterdir()] == ["a-2.mcap"]


def test_a_reserved_file_may_be_deleted_meanwhile(tmp_path: Path) -> None:
    with reserved(tmp_path / "a.mcap") as path:
        path.unlink()
    assert not path.exists()
