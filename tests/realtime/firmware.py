"""The C firmware as a program, built by the system's compiler."""

from __future__ import annotations

import fcntl
import shutil
import subprocess

import pytest

from tests.paths import ROOT

BUILD = ROOT / "build" / "firmware"


def rig_program() -> str:
    """The path of the program; skips where no compiler is."""
    if not (shutil.which("cc") and shutil.which("make")):
        pytest.skip("needs a C compiler and make")
    BUILD.mkdir(parents=True, exist_ok=True)
    with (BUILD / ".lock").open("w") as lock:  # several test workers, one make
        fcntl.flock(lock, fcntl.LOCK_EX)
        subprocess.run(
            ["make", "--silent", "-C", str(ROOT / "drivers" / "firmware"), f"BUILD={BUILD}",
             str(BUILD / "heli3dof-rig")], check=True,
        )  # fmt: skip
    return str(BUILD / "heli3dof-rig")
