"""The command line: verbs by family, one file each. Heavy imports live inside the verbs."""

from __future__ import annotations

import os

import typer

from heli3dof.cli import (
    compare,
    demo,
    diagnose,
    doctor,
    estop,
    files,
    fly,
    models,
    monitor,
    report,
    rigs,
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
    demo, fly, simulate, models, compare, diagnose, report, files,
    rigs, doctor, zero, monitor, estop,
)  # fmt: skip

for family in FAMILIES:
    family.register(app)


def main() -> None:
    """Entry point of the ``heli3dof`` script."""
    # Before numpy is imported. Our matrices are small: several BLAS threads gain nothing, and on
    # a busy machine they wait for each other, which made an identification ten times slower.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    app()
