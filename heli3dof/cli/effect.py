"""``heli3dof effect new``: writes the formula of an unmodelled torque as an effect."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from heli3dof.cli.options import AsJson, Force, Quiet
from heli3dof.cli.output import Output, verb


def register(app: typer.Typer) -> None:
    family = typer.Typer(no_args_is_help=True, rich_markup_mode=None)
    family.callback()(lambda: None)  # otherwise typer makes a family of one verb that verb
    family.command("new")(new)
    app.add_typer(
        family,
        name="effect",
        help="Write an effect of your own.",
        rich_help_panel="Model",
    )


@verb
def new(
    source: Annotated[
        Path,
        typer.Option("--from", metavar="FILE", help="What diagnose --json printed, or its model."),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="Where the package is made.")
    ] = Path(),
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Write an effect from a diagnosis: heli3dof effect new --from diagnosis.json."""
    from heli3dof.diagnosis.effect_package import package_files, read_formulas
    from heli3dof.recording.atomic_write import check_outputs, new_folder, write_file

    out = Output(as_json=as_json, quiet=quiet)
    formulas = read_formulas(source)
    written = []
    for formula in formulas:
        folder = output / f"heli3dof-{formula.name.replace('.', '-').replace('_', '-')}"
        files = package_files(formula, source.name)
        new_folder(folder)
        paths = [folder / name for name in files]
        check_outputs(*paths, force=force)
        for path, text in zip(paths, files.values(), strict=True):
            write_file(path, text.encode(), force=force)
        effect = f"{formula.name}.{formula.axis}"
        out.note(f"Written: {folder}, effect {effect}. To install: pip install {_as_path(folder)}")
        out.note(f"To fit it: heli3dof identify REC.mcap --terms +{effect}")
        written.append({"effect": effect, "folder": str(folder), "files": [str(p) for p in paths]})
    out.emit({"schema": "heli3dof.effect/1", "written": written})


def _as_path(folder: Path) -> str:
    """Return the folder so that pip does not take it for a package of the index."""
    return str(folder) if folder.is_absolute() else f"./{folder}"
