"""Runs the emulated rig behind a pseudo-terminal, in real time, in a process of its own.

``python -m heli3dof_drivers.emulator.transport_pty --device 'mock:?hide=…&seed=…'``

Killing the process is like switching off a rig. The first line on stdout is the terminal's path,
which ``heli3dof … --device serial://PATH`` opens.
"""

from __future__ import annotations

import argparse
import os
import tty

from .transport import emulated, serve


def main() -> None:
    parser = argparse.ArgumentParser(description="The emulated rig at a pseudo-terminal.")
    parser.add_argument(
        "--device", default="mock:", help="URL of the emulated rig; see docs/reference/mock.md"
    )
    parser.add_argument("--with-parent", action="store_true", help="end with the parent process")
    parser.add_argument("--delay-ms", type=float, default=0.0, help="delay of every byte, each way")
    options = parser.parse_args()
    endpoint = emulated(options.device)
    descriptor, path = _terminal()
    print(path, flush=True)
    parent = os.getppid()
    serve(
        endpoint,
        descriptor,
        lambda: not options.with_parent or os.getppid() == parent,
        delay_us=round(1e3 * options.delay_ms),
    )


def _terminal() -> tuple[int, str]:
    """Open a raw pseudo-terminal; return the rig's file descriptor and the path for the host.

    This process also keeps the host's end open, so that the rig keeps running after the host closes
    it.
    """
    rig_end, host_end = os.openpty()
    tty.setraw(host_end)
    return rig_end, os.ttyname(host_end)


if __name__ == "__main__":
    main()
