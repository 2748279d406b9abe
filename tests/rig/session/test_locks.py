"""A lock has one holder, names it, and is released when its process ends."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path

import pytest

from heli3dof.errors import DeviceError
from heli3dof.rig.session.locks import Lock, device_lock_path, is_held

ABOUT = {"pid": 7, "doing": "heli3dof run", "since_utc": "2026-01-01", "device": "usb:"}
HOLDER = """
import sys, time
from pathlib import Path
from heli3dof.rig.session.locks import Lock
lock = Lock(Path(sys.argv[1]), "usb:")
print("held", flush=True)
time.sleep(600)
"""


def test_a_second_holder_gets_an_error_that_names_the_first_and_its_port(tmp_path):
    lock = Lock(tmp_path / "rig", "usb:")
    lock.write_holder(ABOUT)
    with pytest.raises(DeviceError, match=r"pid 7 runs .*, through usb:\.") as caught:
        Lock(tmp_path / "rig", "serial:///dev/null")
    assert "serial:///dev/null is busy" in caught.value.what
    lock.release()
    lock.release()
    Lock(tmp_path / "rig", "usb:").release()


def test_a_killed_process_releases_its_lock(tmp_path):
    path = tmp_path / "rig"
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(path)], stdout=subprocess.PIPE, text=True
    ) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(DeviceError, match="busy"):
            Lock(path, "usb:")
        assert is_held(path)
        holder.kill()
    assert not is_held(path)
    Lock(path, "usb:").release()


def test_a_released_lock_leaves_no_file(tmp_path):
    lock = Lock(tmp_path / "rig", "usb:")
    lock.write_holder(ABOUT)
    lock.release()
    assert list(tmp_path.iterdir()) == []


def test_a_lock_is_never_held_twice(tmp_path):
    path, holding, most = tmp_path / "rig", [0], [0]

    def take_and_leave() -> None:
        for _ in range(200):
            try:
                lock = Lock(path, "usb:")
            except DeviceError:
                continue
            holding[0] += 1
            most[0] = max(most[0], holding[0])
            holding[0] -= 1
            lock.release()

    threads = [threading.Thread(target=take_and_leave) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == [1]


def test_a_device_has_another_lock_after_a_restart():
    assert device_lock_path("A/1", 3) == device_lock_path("A/1", 3)
    paths = {
        device_lock_path(*each) for each in (("A/1", 3), ("A/1", 4), ("A-1", 3), ("A/1", None))
    }
    assert len(paths) == 4
    assert all(isinstance(path, Path) and path.suffix == ".rig" for path in paths)
