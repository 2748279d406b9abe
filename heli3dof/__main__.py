"""Start the heli3dof command line: the command ``heli3dof``, and ``python -m heli3dof``.

Ctrl-C and SIGTERM are handled before the command line's modules are imported.
"""

from __future__ import annotations

import sys

from heli3dof.experiment.control_loop.signal_handling import end_on_signals, ignore_signals


def main() -> None:
    """Run the command line. If a signal interrupts it, report this and exit with status 130."""
    end_on_signals()
    try:
        from heli3dof.cli.app import main as command_line

        command_line()
    except KeyboardInterrupt as error:  # outside a verb, which handles its own interruption
        ignore_signals()
        from heli3dof.cli.output import INTERRUPTED, Output

        as_json = "--json" in sys.argv and not Output.has_emitted
        Output(as_json=as_json).print_interruption(error)
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    main()
