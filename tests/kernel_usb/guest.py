"""In the guest: load the modules, plug the emulated rig in, test the protocol's statements.

Each case is a function with assertions that may return measurements. Results go to the second
serial port, one line of JSON for each case.
"""

from __future__ import annotations

import ctypes
import json
import os
import subprocess
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

RATE_HZ = 20
"""An emulated processor is some twenty times slower; real time is measured elsewhere."""
PROFILE: Any = SimpleNamespace(
    name="guest",
    encoder=SimpleNamespace(roll=4096, pitch=4096, yaw=8192),
    motor=SimpleNamespace(v_max=24.0),
    loop=SimpleNamespace(rate_hz=RATE_HZ),
    dt=1 / RATE_HZ,
)
PATIENCE_S = 40.0
CASES: list[tuple[str, Callable[[], dict[str, Any] | None]]] = []


def case(function: Callable[[], dict[str, Any] | None]) -> Callable[[], dict[str, Any] | None]:
    CASES.append((function.__name__.replace("_", " "), function))
    return function


class Hand:
    """Sends commands to the device's process."""

    def __init__(self, module: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", module],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1,
        )  # fmt: skip

    def __call__(self, line: str) -> str:
        assert self._process.stdin
        assert self._process.stdout
        assert self._process.poll() is None, "the device's process has ended"
        self._process.stdin.write(line + "\n")
        answer = self._process.stdout.readline().strip()
        assert answer, f"the device's process ended at {line!r}"
        return answer

    def state(self) -> tuple[int, int, int, int]:
        """flags, cause, front and back in µV"""
        flags, cause, front, back = map(int, self("state").split())
        return flags, cause, front, back


def until(true: Callable[[], Any], what: str) -> Any:
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        if value := true():
            return value
        time.sleep(0.05)
    raise AssertionError(f"not within {PATIENCE_S:g} s: {what}")


def fly(rig: Any, periods: int, volts: float = 5.0) -> list[Any]:
    from heli3dof.rig.interface import Command

    samples = [rig.arm()]
    start = time.monotonic()
    for k in range(periods):
        samples.append(rig.exchange(Command(k + 1, volts, volts), start + (k + 1) / RATE_HZ))
    return samples


def failure(action: Callable[[], Any]) -> Any:
    """The DeviceError of an action; it must have a cause and a fix."""
    from heli3dof.errors import DeviceError

    result = None
    try:
        action()
    except DeviceError as error:
        result = error
    assert result is not None, "no DeviceError"
    assert result.cause
    assert result.fix
    return result


_PREAMBLE = """
from heli3dof.errors import DeviceError
from heli3dof.rig.url import parse_url
from tests.kernel_usb.guest import PROFILE as profile, fly
"""


def in_another_process(code: str, user: int = 0) -> str:
    """The output of a second process."""
    done = subprocess.run(
        [sys.executable, "-c", _PREAMBLE + code],
        capture_output=True, text=True, user=user, group=user, extra_groups=[],
    )  # fmt: skip
    assert not done.returncode, done.stderr
    return done.stdout.strip()


def flying_process(setup: str) -> subprocess.Popen[str]:
    """A second process that runs the rig; ``setup`` defines its ``driver`` and ``url``."""
    code = _PREAMBLE + setup + "fly(driver.open(url, profile), 10000)"
    return subprocess.Popen([sys.executable, "-c", code])


def load_modules() -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    for path in sorted(Path("/modules").iterdir()):
        data = path.read_bytes()
        if libc.syscall(175, data, len(data), b"") and ctypes.get_errno() != 17:  # init_module
            raise OSError(ctypes.get_errno(), f"{path.name} does not load")


def main() -> None:
    from . import cases_serial, cases_usb, cases_conformance  # noqa: F401, I001

    out = os.fdopen(os.open("/dev/ttyS1", os.O_WRONLY | os.O_NOCTTY), "w", buffering=1)

    def say(**result: Any) -> None:
        out.write(json.dumps(result) + "\n")

    start = time.monotonic()
    load_modules()
    say(kernel=os.uname().release, booted_s=start, modules_s=time.monotonic() - start)
    wanted = sys.argv[1:]
    for name, function in CASES:
        if wanted and not any(w in name for w in wanted):
            continue
        begin = time.monotonic()
        try:
            measured = function()
            say(case=name, ok=True, took_s=time.monotonic() - begin, measured=measured or {})
        except BaseException:
            problem = traceback.format_exc()
            say(case=name, ok=False, took_s=time.monotonic() - begin, problem=problem)
    say(done=True)
    out.close()
    time.sleep(0.5)


if __name__ == "__main__":
    # Under its own name, so that the cases register where main() looks.
    from tests.kernel_usb import guest

    guest.main()
