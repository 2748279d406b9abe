"""``identify``: models from recordings."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heli3dof.cli.console import Talk, verb
from heli3dof.cli.options import AsJson, Force, Output, ProfileFile, Quiet, Recordings

if TYPE_CHECKING:
    from rich.table import Table

    from heli3dof.identification.api import Identification


class Method(StrEnum):
    pem = "pem"
    pbsid = "pbsid"
    tf4 = "tf4"
    oe = "oe"


def register(app: typer.Typer) -> None:
    app.command("identify")(identify)


@verb
def identify(
    recordings: Recordings,
    method: Annotated[
        Method,
        typer.Option(help="pem: prediction error; pbsid: subspace; tf4: the paper's form; oe."),
    ] = Method.pem,
    order: Annotated[
        int | None, typer.Option("--order", help="Number of states; chosen when not given.")
    ] = None,
    holdout: Annotated[
        list[Path] | None,
        typer.Option("--holdout", metavar="REC", help="Validate on this recording. Repeatable."),
    ] = None,
    name: Annotated[str | None, typer.Option("--name", help="The model's name.")] = None,
    profile: ProfileFile = None,
    output: Output = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Models from recordings: heli3dof identify rec.mcap -o model.json."""
    from heli3dof.cli.loading import load_all
    from heli3dof.identification.api import identify as fit
    from heli3dof.model.modelfile import save_model
    from heli3dof.recording.output import check_output

    talk = Talk(as_json=as_json, quiet=quiet)
    path = output or Path(f"{recordings[0].name.split('.')[0]}-{method.value}.json")
    check_output(path, force=force)
    train = load_all(talk, recordings, profile)
    test = load_all(talk, holdout or [], profile)
    with talk.working(f"Identifying ({method.value}) from {len(train)} recording(s) …"):
        found = fit(train, method=method.value, order=order, holdout=test or None, name=name)
    save_model(found.model, path, force=force)
    for sentence in found.sentences():
        if not sentence.startswith("Warning: "):
            talk.show(sentence)
    talk.show(_poles(found), _fits(found))
    talk.show("\n".join(found.transfer.lines()))
    for warning in found.warnings:
        talk.warn(warning)
    talk.note(f"Model: {path}")
    talk.emit({"schema": "heli3dof.identification/1", "models": [found.to_json(str(path))]})


def _poles(found: Identification) -> Table:
    from rich.table import Table

    table = Table("pole, 1/s", "standard deviation", title="Poles, continuous time")
    for pole in found.poles:
        value, im = pole.value, abs(pole.value.imag)
        text = f"{value.real:+.4g}" + (f" {'+' if value.imag > 0 else '-'} {im:.4g}j" if im else "")
        std = f"{pole.std_real:.2g}" + (f", {pole.std_imag:.2g}j" if im else "")
        table.add_row(text, std if pole.std_real == pole.std_real else "–")
    return table


def _fits(found: Identification) -> Table:
    from rich.table import Table

    from heli3dof.axes import AXES

    metrics = found.metrics
    scores = {
        ("one step" if h == 0 else f"{h:g} s ahead"): s for h, s in metrics.prediction.items()
    }
    scores["loop replay"] = metrics.replay
    table = Table(
        "axis", *scores, title="Fit on held-out data, %", caption=metrics.replay_note or None
    )
    for i, axis in enumerate(AXES):
        cells = [float(s.fit_percent[i]) for s in scores.values()]
        table.add_row(axis, *(f"{v:.1f}" if v == v else "–" for v in cells))
    return table
