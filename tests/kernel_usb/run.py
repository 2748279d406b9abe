"""``python -m tests.kernel_usb.run``: fetch, build, boot, and print the guest's results."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from . import image
from .packages import EMULATOR, Missing, fetch

FOLDER = image.ROOT / "build" / "kernel-usb"
MEMORY_MB = 768
# One emulated processor: of two, each waits for this machine to run the other.
PROBLEM_LINES = 4
"""of a traceback. results.jsonl has all of it, console.log the output of other processes"""
LONGEST_S = 600
"""s for the guest, on a machine that is busy with other things"""


def boot(root: Path, arguments: Sequence[str]) -> list[dict[str, Any]]:
    """One run of the guest: its lines. Raises Missing where qemu does not start."""
    initrd, console, results = (FOLDER / n for n in ("initrd", "console.log", "results.jsonl"))
    initrd.write_bytes(image.build(root, " ".join(arguments)))
    results.unlink(missing_ok=True)
    (kernel,) = (root / "boot").glob("vmlinuz-*")
    share = root / "usr/share"
    libraries = [root / "usr/lib/x86_64-linux-gnu", root / "lib/x86_64-linux-gnu"]
    command = [
        str(next((root / "usr/bin").glob("qemu-system-x86_64"))),
        "-L", str(share / "seabios"), "-L", str(share / "qemu"),
        "-accel", "tcg", "-smp", "1", "-m", str(MEMORY_MB),
        "-nodefaults", "-no-reboot", "-display", "none", "-nic", "none",
        "-kernel", str(kernel), "-initrd", str(initrd),
        "-append", "console=ttyS0 loglevel=7 panic=-1 mitigations=off",
        "-serial", f"file:{console}", "-serial", f"file:{results}",
    ]  # fmt: skip
    modules = root / "usr/lib/x86_64-linux-gnu/qemu"
    environment = {
        "LD_LIBRARY_PATH": ":".join(map(str, libraries)),
        "QEMU_MODULE_DIR": str(modules),
    }
    try:
        done = subprocess.run(
            command, env=environment, timeout=LONGEST_S, capture_output=True, text=True
        )
        if done.returncode:
            raise Missing(f"{EMULATOR} does not run: {done.stderr.strip()}")
    except subprocess.TimeoutExpired:
        print(f"The guest did not end within {LONGEST_S} s; {console} has its last output.")
    text = results.read_text(encoding="utf-8", errors="replace") if results.exists() else ""
    return [json.loads(line) for line in text.splitlines() if line.startswith("{")]


def run_guest(arguments: Sequence[str] = ()) -> list[dict[str, Any]]:
    """The guest's lines: the kernel, one for each case, ``done`` last. Raises Missing.

    ``arguments``: run only the cases whose name contains one of these words.
    """
    return boot(fetch(FOLDER), arguments)


def main() -> int:
    start = time.monotonic()
    try:
        lines = run_guest(sys.argv[1:])
    except Missing as reason:
        print(f"The test with a real USB stack cannot run here: {reason}")
        return 1
    cases = [line for line in lines if "case" in line]
    for line in lines:
        if "kernel" in line:
            print(f"Linux {line['kernel']}, up after {line['booted_s']:.1f} s")
    for line in cases:
        print(f"{'ok    ' if line['ok'] else 'FAILED'} {line['took_s']:6.2f} s  {line['case']}")
        for name, value in line.get("measured", {}).items():
            shown = f"{value:.4g}" if isinstance(value, float) else value
            print(f"                    {name}: {shown}")
        if not line["ok"]:
            print("    " + "\n    ".join(line["problem"].splitlines()[-PROBLEM_LINES:]))
    good = sum(line["ok"] for line in cases)
    whole = any("done" in line for line in lines)
    print(f"{good} of {len(cases)} cases hold; {time.monotonic() - start:.0f} s in all.")
    if not whole:
        print(f"The guest ended early; its console: {FOLDER / 'console.log'}")
    return 0 if whole and cases and good == len(cases) else 1


if __name__ == "__main__":
    sys.exit(main())
