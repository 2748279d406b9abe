"""``python -m heli3dof_drivers.emulator.transport_pty --device 'mock:?hide=…&seed=…'``

The emulated rig behind a pseudo-terminal, in real time, in a process of its own that can be
killed, stopped and started as a rig can. The terminal's path is the first line on stdout;
``heli3dof … --device serial://PATH`` opens it.
"""

from __future__ import annotations

import argparse
import os
import tty

from .transport import emulated, serve


def main() -> None:
    parser = argparse.ArgumentParser(description="The emulated rig behind a pseudo-terminal.")
    parser.add_argument("--device", default="mock:", help="which rig; see docs/reference/mock.md")
    parser.add_argument(
        "--with-parent", action="store_true", help="end when the process that started this ends"
    )
    parser.add_argument(
        "--delay-ms", type=float, default=0.0, help="every byte takes so long, each way"
    )
    options = parser.parse_args()
    endpoint = emulated(options.device)
    host_side, path = _terminal()
    print(path, flush=True)
    parent = os.getppid()
    serve(
        endpoint,
        host_side,
        lambda: not options.with_parent or os.getppid() == parent,
        delay_us=round(1e3 * options.delay_ms),
    )


def _terminal() -> tuple[int, str]:
    """A raw pseudo-terminal: our end, and the other's path.

    The other end stays open here too: a rig does not go away when its host does.
    """
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    return ours, os.ttyname(theirs)


if __name__ == "__main__":
    main()
