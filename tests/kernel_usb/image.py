"""The guest's initramfs: busybox, this machine's Python, the project, and the kernel's USB modules.

A newc archive needs no privileges: device nodes are only entries in it. Files keep the paths they
have here, so that Python finds itself.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
MODULES = ("vhci-hcd", "dummy_hcd", "usb_f_acm", "cdc-acm")
FIRMWARE = ROOT / "build/firmware/heli3dof-rig"
LIBRARIES = "/usr/lib/guest"
PACKAGES = (
    "usb", "serial", "cobs", "pydantic", "pydantic_core", "annotated_types", "typing_inspection",
    "typing_extensions.py",
)  # fmt: skip
"""The libraries that the guest's side imports"""
NOT_IN_THE_GUEST = re.compile(
    r"/(test|tests|idlelib|tkinter|turtledemo|lib2to3|ensurepip|site-packages|config-[^/]*|"
    r"pydoc_data|distutils|__pycache__)(/|$)|opt-[12]\.pyc$|_test[^/]*\.so$"
)
INIT = """#!/bin/busybox sh
/bin/busybox mkdir -p /proc /sys /dev /tmp /etc /run/udev
/bin/busybox mount -t proc proc /proc
/bin/busybox mount -t sysfs sysfs /sys
/bin/busybox mount -t devtmpfs devtmpfs /dev
/bin/busybox mkdir -p /dev/pts
/bin/busybox mount -t devpts devpts /dev/pts
/bin/busybox ln -s /proc/self/fd /dev/fd
/sbin/ldconfig
/lib/systemd/systemd-udevd --daemon
PYTHONPATH=/py PYTHONDONTWRITEBYTECODE=1 {python} -m tests.kernel_usb.guest {arguments}
/bin/busybox poweroff -f
"""


class Archive:
    """A cpio archive in the format that kernels unpack ("newc")."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._names: set[str] = set()

    def _entry(
        self, name: str, mode: int, data: bytes = b"", rdev: tuple[int, int] = (0, 0)
    ) -> None:
        name = name.strip("/")
        if name in self._names:
            return
        self._names.add(name)
        raw = name.encode() + b"\0"
        fields = (len(self._names), mode, 0, 0, 1, 0, len(data), 0, 0, *rdev, len(raw), 0)
        head = b"070701" + b"".join(b"%08x" % f for f in fields) + raw
        self._parts += [head, bytes(-len(head) % 4), data, bytes(-len(data) % 4)]

    def folder(self, name: str) -> None:
        for parent in reversed(Path("/" + name.strip("/")).parents):
            if str(parent) != "/":
                self._entry(str(parent), 0o040755)
        self._entry(name, 0o040755)

    def file(self, name: str, data: bytes, mode: int = 0o644) -> None:
        self.folder(str(Path("/" + name.strip("/")).parent))
        self._entry(name, 0o100000 | mode, data)

    def copy(self, source: Path, name: str | None = None) -> None:
        """A file, with the targets of its links."""
        self.file(
            name or str(source), source.read_bytes(), 0o755 if os.access(source, os.X_OK) else 0o644
        )

    def device(self, name: str, major: int, minor: int) -> None:
        self.folder(str(Path("/" + name.strip("/")).parent))
        self._entry(name, 0o020600, rdev=(major, minor))

    def bytes(self) -> bytes:
        self._entry("TRAILER!!!", 0)
        return b"".join(self._parts)


def build(root: Path, arguments: str = "") -> bytes:
    """The whole image. ``root``: the folder to which `packages.fetch` unpacked."""
    archive = Archive()
    archive.device("/dev/console", 5, 1)
    archive.copy(root / "bin/busybox", "/bin/busybox")
    python = Path(sys._base_executable).resolve()  # type: ignore[attr-defined]
    archive.file("/init", INIT.format(python=python, arguments=arguments).encode(), 0o755)
    for part in _python(archive, python):
        _shared(archive, part)
    (libusb,) = root.rglob("libusb-1.0.so.0")
    archive.copy(libusb, f"{LIBRARIES}/{libusb.name}")
    _shared(archive, libusb, root)
    archive.file("/etc/ld.so.conf", f"{LIBRARIES}\n".encode())
    archive.copy(Path("/sbin/ldconfig"))
    _udev(archive, root)
    _project(archive)
    if FIRMWARE.exists():
        archive.copy(FIRMWARE, "/firmware/heli3dof-rig")
        _shared(archive, FIRMWARE)
    for number, module in enumerate(modules(root, MODULES)):
        archive.copy(module, f"/modules/{number:02d}-{module.name}")
    return archive.bytes()


def _python(archive: Archive, python: Path) -> Iterator[Path]:
    """Interpreter and standard library; yields what is linked against shared libraries."""
    archive.copy(python)
    yield python
    library = Path(sysconfig.get_path("stdlib"))
    for path in sorted(library.rglob("*")):
        if path.is_file() and not NOT_IN_THE_GUEST.search(str(path)[len(str(library)) :]):
            archive.copy(path)
            if path.suffix == ".so":
                yield path


def _shared(archive: Archive, binary: Path, root: Path | None = None) -> None:
    """The shared libraries of a binary, as this machine's loader finds them, or those in root."""
    path = f"{root}/usr/lib/x86_64-linux-gnu:{root}/lib/x86_64-linux-gnu" if root else ""
    listed = subprocess.run(
        ["ldd", str(binary)], capture_output=True, text=True, env={"LD_LIBRARY_PATH": path}
    ).stdout
    for name in re.findall(r"(/\S+) \(0x", listed):
        result = Path(name)
        inside = root is not None and result.is_relative_to(root)
        archive.copy(result, f"{LIBRARIES}/{result.name}" if inside else None)


def _udev(archive: Archive, root: Path) -> None:
    """Debian's udev with the rules that ship and no others."""
    for name in ("lib/systemd/systemd-udevd", "bin/udevadm"):
        binary = _inside(root, root / name)
        archive.copy(binary, f"/{name}")
        _shared(archive, binary, root)
    rules = ROOT / "drivers/70-heli3dof.rules"
    archive.copy(rules, f"/etc/udev/rules.d/{rules.name}")


def _inside(root: Path, path: Path) -> Path:
    """Where a file of ``root`` is: a package's absolute links are meant from there."""
    while path.is_symlink():
        to = path.readlink()
        path = root / to.relative_to("/") if to.is_absolute() else path.parent / to
    return path


def _project(archive: Archive) -> None:
    """heli3dof, its drivers, the few libraries they need here, and this test."""
    pure = Path(sysconfig.get_path("purelib"))
    trees = {
        "heli3dof": ROOT / "heli3dof",
        "heli3dof_drivers": ROOT / "drivers",
        "tests/kernel_usb": ROOT / "tests/kernel_usb",
        "tests/drivers/emulator": ROOT / "tests/drivers/emulator",
        **{name: pure / name for name in PACKAGES},
    }
    for name, tree in trees.items():
        for path in sorted(tree.rglob("*")) if tree.is_dir() else [tree]:
            if path.suffix in (".py", ".toml", ".rules", ".so"):
                archive.copy(path, f"/py/{name}/{path.relative_to(tree)}".removesuffix("/."))
            if path.suffix == ".so":
                _shared(archive, path)
    archive.file("/py/tests/__init__.py", b"")
    archive.file("/py/tests/drivers/__init__.py", b"")


def modules(root: Path, wanted: tuple[str, ...]) -> list[Path]:
    """Kernel modules with their dependencies, in loading order."""
    there = {p.stem.replace("-", "_"): p for p in (root / "lib/modules").rglob("*.ko")}
    order: list[Path] = []

    def add(name: str) -> None:
        path = there[name.replace("-", "_")]
        result = re.search(rb"\0depends=([^\0]*)\0", path.read_bytes())
        for below in result[1].decode().split(",") if result else []:
            if below:
                add(below)
        if path not in order:
            order.append(path)

    for name in wanted:
        add(name)
    return order
