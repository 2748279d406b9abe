"""The options that verbs share, so that they read and mean the same everywhere."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Device = Annotated[
    str,
    typer.Option(
        "--device",
        metavar="URL",
        envvar="HELI3DOF_DEVICE",
        help="Which rig: mock:?seed=1, serial:///dev/ttyACM0 … (heli3dof devices lists them).",
    ),
]
ProfileFile = Annotated[
    Path | None,
    typer.Option("--profile", metavar="FILE", help="The rig's numbers; default: the paper's rig."),
]
LogProfile = Annotated[
    Path | None,
    typer.Option(
        "--profile",
        metavar="FILE",
        help="The rig's numbers: a log needs them, a recording has its own.",
    ),
]
Output = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="FILE", help="Where to write.")
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite the output file if it exists.")]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Say only what went wrong.")]
Seed = Annotated[
    int, typer.Option("--seed", min=0, help="Seed of everything drawn at random, from 0.")
]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Check everything and say what would be flown.")
]
Recordings = Annotated[
    list[Path], typer.Argument(metavar="REC...", help="Recordings: .mcap, or .csv/.mat logs.")
]
