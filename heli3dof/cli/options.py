"""Define the options that several subcommands share, with one name and meaning everywhere."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heli3dof.cli import completion
from heli3dof.rig.url import DEVICE_VARIABLE

if TYPE_CHECKING:
    from heli3dof.cli.output import Output
    from heli3dof.rig.profile import Profile


def _device(help: str) -> Any:
    return typer.Option(
        "--device",
        metavar="URL",
        envvar=DEVICE_VARIABLE,
        autocompletion=completion.devices,
        help=help,
    )


Device = Annotated[
    str,
    _device("The rig, e.g. mock:?seed=1 or serial:///dev/ttyACM0; heli3dof devices lists them."),
]
AnyDevice = Annotated[
    str | None, _device("The rig; default: the only one found, else the emulated one.")
]
ProfileFile = Annotated[
    Path | None,
    typer.Option("--profile", metavar="FILE", help="The rig's profile; default: the paper's rig."),
]
LogProfile = Annotated[
    Path | None,
    typer.Option(
        "--profile", metavar="FILE", help="The rig's profile. Logs need it; recordings contain it."
    ),
]
OutputFile = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="FILE", help="The file to write.")
]
ReportFile = Annotated[
    Path | None,
    typer.Option(
        "--report", metavar="FILE", help="Also write figures and tables to this HTML file."
    ),
]
Holdout = Annotated[
    list[Path] | None,
    typer.Option(
        "--holdout",
        metavar="REC",
        help="Validate on this recording. Repeatable.",
        autocompletion=completion.recordings,
    ),
]
Columns = Annotated[
    str | None,
    typer.Option("--columns", metavar="A,B,...", help="Names of a MAT matrix's rows or columns."),
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite the output file if it exists.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document on stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print warnings and errors only.")]
Verbose = Annotated[bool, typer.Option("--verbose", help="Print all tables, not a summary.")]
PaperNumbers = Annotated[
    bool,
    typer.Option(
        "--paper",
        help="Also show the paper's numbers. Default: only for the recordings that come with "
        "heli3dof.",
    ),
]
Quick = Annotated[
    bool,
    typer.Option("--quick", help="Faster: fewer null simulations, no cross-validation."),
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of all random numbers, from 0.")]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Check and print the plan; open and move nothing.")
]
Recordings = Annotated[
    list[Path],
    typer.Argument(
        metavar="REC...",
        help="Recordings (.mcap), or .csv and .mat logs.",
        autocompletion=completion.recordings,
    ),
]
Recording = Annotated[
    Path,
    typer.Argument(
        metavar="REC", help="A recording or a log.", autocompletion=completion.recordings
    ),
]
Plan = Annotated[
    str,
    typer.Argument(
        metavar="PLAN", help="A plan's name, or its TOML file.", autocompletion=completion.plans
    ),
]
Cluster = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="ADDRESS",
        envvar="DASK_SCHEDULER_ADDRESS",
        help="Compute on this Dask cluster, e.g. tcp://lab:8786.",
    ),
]


def rig_profile(file: Path | None) -> Profile:
    """Return a rig's profile from the file of ``--profile``; None gives the paper's rig."""
    from heli3dof.rig.profile import default_profile

    return log_profile(file) or default_profile()


def log_profile(file: Path | None) -> Profile | None:
    """Return the profile in the file of ``--profile``, or None if the option is omitted.

    The file is a TOML file, or a recording of heli3dof (``.mcap``), which contains a profile.
    """
    from heli3dof.rig.profile import load_profile, profile_from_dict

    if file is not None and file.suffix == ".mcap":
        from heli3dof.recording.mcap_files.reader import read_recording

        return profile_from_dict(read_recording(file).profile.to_dict(), source=str(file))
    return load_profile(file) if file else None


def device_or_default(out: Output, device: str | None) -> str:
    """Return ``device``; if it is None, the URL of the rig that is found.

    The rig found is the real rig if there is exactly one. If there is none, it is the emulated rig,
    and this function prints a note. Raises UsageError if several real rigs are found, or if
    ``device`` has a wrong scheme or option.
    """
    from heli3dof.rig.drivers import MOCK, check_url, found_device

    if device is not None:
        check_url(device)
        return device
    found = found_device()
    if found == MOCK:
        out.note("No rig was found. This is the emulated one; --device selects another.")
    return found
