"""Builds the firmware with the system's compiler, once, and runs it."""

from __future__ import annotations

import fcntl
import functools
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.paths import ROOT

SOURCES = ROOT / "drivers" / "firmware"
BUILD = ROOT / "build" / "firmware"
COMPILER = shutil.which("cc") and shutil.which("make")


@functools.cache
def build(*targets: str) -> Path:
    """The folder with the built targets; skips where there is no C compiler."""
    if not COMPILER:
        pytest.skip("needs a C compiler and make: apt-get install gcc make libc6-dev")
    BUILD.mkdir(parents=True, exist_ok=True)
    with (BUILD / ".lock").open("w") as lock:  # several test workers, one make
        fcntl.flock(lock, fcntl.LOCK_EX)
        wanted = [str(BUILD / t) for t in targets]
        made = subprocess.run(
            ["make", "--silent", "-C", str(SOURCES), f"BUILD={BUILD}", *wanted],
            capture_output=True,
            text=True,
        )
    assert made.returncode == 0, made.stderr
    return BUILD


@functools.cache
def sanitizers() -> bool:
    """Whether the system's compiler links them."""
    command = ["cc", "-fsanitize=address,undefined", "-xc", "-", "-o", "/dev/null"]
    source = "int main(void) { return 0; }"
    return (
        bool(COMPILER)
        and not subprocess.run(command, input=source, text=True, capture_output=True).returncode
    )


def rig_program() -> str:
    """The path of the program that serves the firmware on a PTY."""
    return str(build("heli3dof-rig") / "heli3dof-rig")


def run(program: str, *arguments: str, text: str = "") -> list[str]:
    """The lines that a built program prints."""
    done = subprocess.run(
        [str(build(program) / program), *arguments], input=text, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    return done.stdout.splitlines()
