"""``heli3dof effect new|list|check``: writes, lists and checks effects."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heli3dof.cli.options import Force
from heli3dof.cli.output import Output, add_family, verb
from heli3dof.errors import CheckFailed, UsageError, quoted

if TYPE_CHECKING:
    from collections.abc import Mapping


def register(app: typer.Typer) -> None:
    verbs = {"new": new, "list": list_effects, "check": check}
    help = "Write, list and check effects: heli3dof effect list."
    add_family(app, "effect", verbs, help=help, heading="Model")


@verb
def new(
    out: Output,
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[NAME]",
            help="Name of the new effect, such as magnet.detent.",
            show_default=False,
        ),
    ] = None,
    source: Annotated[
        Path | None,
        typer.Option("--from", metavar="FILE", help="JSON output or model file of diagnose."),
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="Where to create the package.")
    ] = Path(),
    force: Force = False,
) -> None:
    """Write a package with an effect: effect new NAME, or effect new --from diagnosis.json."""
    from heli3dof.effect_files.from_diagnosis import package_files, read_formulas
    from heli3dof.effect_files.template import template_files

    if (name is None) == (source is None):
        raise UsageError(
            "effect new needs either a name or --from FILE.",
            cause="a name gives an equation to replace, --from the formula of a diagnosis.",
            fix="heli3dof effect new magnet.detent, or heli3dof effect new --from diagnosis.json",
        )
    written = []
    if name is not None:
        folder, paths = _write(output, name, template_files(name), force=force)
        out.note(f"Written: {folder}. Replace the equation in {paths[1]}, {paths[2]} and the test "
                 f"{paths[3]}")  # fmt: skip
        out.note(f"To check it: heli3dof effect check {quoted(paths[1])}. To install: pip install "
                 f"{_as_path(folder)}")  # fmt: skip
        written.append({"effect": name, "folder": str(folder), "files": [str(p) for p in paths]})
    for formula in [] if source is None else read_formulas(source):
        assert source is not None
        files = package_files(formula, source.name)
        folder, paths = _write(output, formula.name, files, force=force)
        effect = f"{formula.name}.{formula.axis}"
        out.note(f"Written: {folder}, effect {effect}. To install: pip install {_as_path(folder)}")
        out.note(f"To fit it: heli3dof identify REC.mcap --terms +{effect}")
        written.append({"effect": effect, "folder": str(folder), "files": [str(p) for p in paths]})
    out.emit({"schema": "heli3dof.effect/1", "written": written})


def _write(
    output: Path, name: str, files: Mapping[str, str], *, force: bool
) -> tuple[Path, list[Path]]:
    """Write the files of an effect's package; return its folder and their paths."""
    from heli3dof.recording.atomic_write import check_outputs, new_folder, write_file

    folder = output / f"heli3dof-{name.replace('.', '-').replace('_', '-')}"
    new_folder(folder)
    paths = [folder / file for file in files]
    check_outputs(*paths, force=force)
    for path, text in zip(paths, files.values(), strict=True):
        write_file(path, text.encode(), force=force)
    return folder, paths


@verb
def list_effects(out: Output) -> None:
    """List all effects, also of installed packages: axes, parameters with units, package."""
    from heli3dof.model.effects import effects, plug_ins

    packages = plug_ins()
    listed = []
    for name, effect in effects().items():
        parameters = [{"name": p.name, "unit": p.unit} for p in effect.parameters]
        sizes = ", ".join(f"{p.name} ({p.unit})" for p in effect.parameters) or "–"
        axes = f" on {', '.join(effect.axes)}" if effect.axes else ""
        package = f"; from {packages[name]}" if name in packages else ""
        out.show(f"{name}{axes}: {sizes}{package}")
        listed.append(
            {
                "effect": name,
                "axes": list(effect.axes),
                "parameters": parameters,
                "summary": effect.summary,
                "package": packages[name].distribution if name in packages else None,
            }
        )
    out.note("Equations and what each is confounded with: docs/reference/effects.md")
    out.emit({"schema": "heli3dof.effects/1", "effects": listed})


@verb
def check(
    out: Output,
    effect: Annotated[
        str, typer.Argument(metavar="FILE|NAME", help="A Python file, or an installed effect.")
    ],
) -> None:
    """Check an effect's units, equation and names: effect check FILE.py."""
    from heli3dof.effect_files.check import effect_of_file, problems
    from heli3dof.experiment.plan import named_plans
    from heli3dof.model.effects import effects, term

    if effect.endswith(".py") or "/" in effect:
        checked = effect_of_file(Path(effect))
    else:
        checked = effects().get(effect) or term(effect).effect
    found = problems(checked, named_plans())
    out.fail(*found)
    if not found:
        out.show(f"{checked.name}: units, equation and names are in order.")
    out.emit({"schema": "heli3dof.effect_check/1", "effect": checked.name, "problems": found})
    if found:
        raise typer.Exit(CheckFailed.exit_code)


def _as_path(folder: Path) -> str:
    """Return the folder as a path with ``./``, so that pip takes it for a path, not a name."""
    return quoted(folder if folder.is_absolute() else f"./{folder}")
