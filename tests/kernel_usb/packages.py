"""Debian packages, fetched with apt and unpacked into build/, never installed."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

EMULATOR = "qemu-system-x86"
KERNEL = "linux-image-amd64"
ALONE = (
    "qemu-system-common", "busybox-static", "libusb-1.0-0", "libudev1",
    "udev", "libacl1", "libblkid1", "libkmod2", "libselinux1", "libcap2",
)  # fmt: skip
"""Without their dependencies: only the accelerator of the first is used."""
# Programs here use this system's own; the rest are sound, screens and tools that are not run.
NOT_NEEDED = re.compile(
    r"libc6|libgcc-s1|gcc-.*|dpkg|tar|debconf|cdebconf|adduser|passwd|install-info|iso-codes|"
    r"qemu-system-common|qemu-system-gui|libselinux1|readline-common|libpam.*|ipxe-qemu|libaudit.*"
)


class Missing(Exception):
    """A package or a tool that this machine cannot get."""


def fetch(folder: Path) -> Path:
    """The folder ``folder``/root with all packages unpacked. Raises Missing with the reason."""
    root, archives, complete = folder / "root", folder / "packages", folder / "complete"
    wanted = "\n".join((EMULATOR, KERNEL, *ALONE, NOT_NEEDED.pattern))
    if complete.exists() and complete.read_text() == wanted:
        return root
    for tool in ("apt-get", "apt-cache", "dpkg"):
        if shutil.which(tool) is None:
            raise Missing(f"{tool} is not here: this test needs Debian, or a relative of it.")
    archives.mkdir(parents=True, exist_ok=True)
    for name in sorted({*closure(EMULATOR), *ALONE, newest_kernel()}):
        if list(archives.glob(f"{name}_*.deb")):
            continue
        done = subprocess.run(
            ["apt-get", "download", name], cwd=archives, capture_output=True, text=True
        )
        if done.returncode:
            reason = done.stderr.strip() or done.stdout.strip()
            raise Missing(f"{name} cannot be had: {reason} (apt-get update?)")
    shutil.rmtree(root, ignore_errors=True)
    for archive in sorted(archives.glob("*.deb")):
        subprocess.run(["dpkg", "-x", str(archive), str(root)], check=True)
    complete.write_text(wanted)
    return root


def depends(name: str) -> list[str]:
    """Direct dependencies of a package; the first of alternatives."""
    options = ["recommends", "suggests", "conflicts", "breaks", "replaces", "enhances"]
    done = subprocess.run(
        ["apt-cache", "depends", *(f"--no-{o}" for o in options), name],
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise Missing(f"apt knows no package {name}: {done.stderr.strip()} (apt-get update?)")
    return re.findall(r"^  (?:Pre)?Depends: ([\w.+-]+)$", done.stdout, re.MULTILINE)


def closure(name: str) -> Iterable[str]:
    """The package and everything below it that this system may lack."""
    result, waiting = set(), [name]
    while waiting:
        one = waiting.pop()
        if one in result or NOT_NEEDED.fullmatch(one):
            continue
        result.add(one)
        waiting += depends(one)
    return result


def newest_kernel() -> str:
    """The package with the kernel itself, which the other only points to."""
    for name in depends(KERNEL):
        if name.startswith("linux-image-"):
            return name
    raise Missing(f"{KERNEL} depends on no kernel.")
