"""The command line: verbs by family, one file each. Heavy imports live inside the verbs."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

import typer

from heli3dof.cli import (
    compare,
    demo,
    devices,
    diagnose,
    doctor,
    estop,
    files,
    identify,
    monitor,
    output_encoding,
    plans,
    profile,
    report,
    run,
    simulate,
    zero,
)

app = typer.Typer(
    name="heli3dof",
    help="From a 3-DOF helicopter on the bench to a model that can be trusted.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)

FAMILIES = (
    demo, run, simulate, identify, compare, diagnose, report, files,
    profile, plans, devices, doctor, zero, monitor, estop,
)  # fmt: skip

QUICK: dict[str, tuple[Callable[..., None], dict[str, str], dict[str, str]]] = {
    "estop": (
        estop.estop,
        {"--json": "as_json", "--quiet": "quiet"},
        {"--device": "device", "--reason": "reason"},
    ),
    "devices": (
        devices.devices,
        {"--ask": "ask", "--json": "as_json", "--quiet": "quiet"},
        {},
    ),
}
"""Verbs that nobody waits for: the function, its flags, its options with a value"""

for family in FAMILIES:
    family.register(app)


def main() -> None:
    """Entry point of the ``heli3dof`` script."""
    # Before numpy is imported. Our matrices are small: several BLAS threads gain nothing, and on
    # a busy machine they wait for each other, which made an identification ten times slower.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    output_encoding.prepare()
    try:
        without_delay(sys.argv[1:])
        app()
    except SystemExit as end:
        code = 0 if output_encoding.reader_has_gone(end) else end.code
    except OSError as error:  # of --help and its like; a verb's own are explained by the verb
        code = output_encoding.lost(error)
    sys.exit(output_encoding.finish(code))


def without_delay(words: Sequence[str]) -> None:
    """A `QUICK` verb as it is meant to be typed, and the process's end; else nothing.

    To read even one flag typer builds a validator, and loads pydantic for it: half of the time
    until a rig stands still. What is not understood here at once is typer's to read or to refuse.
    """
    if not words or words[0] not in QUICK:
        return
    verb, flags, values = QUICK[words[0]]
    given: dict[str, Any] = {}
    rest = iter(words[1:])
    for word in rest:
        name, _, value = word.partition("=")
        if word in flags:
            given[flags[word]] = True
        elif name in values and (value := value or next(rest, "")) and value[0] != "-":
            given[values[name]] = value
        else:
            return
    try:
        verb(**given)
    except typer.Exit as end:
        sys.exit(end.exit_code)
    sys.exit(0)
