"""``heli3dof exercise``: hides effects in emulated rigs for students, and marks the answers."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heli3dof.axes import AXES
from heli3dof.cli.options import Force, OutputFile, Seed
from heli3dof.cli.output import Output, add_family, verb
from heli3dof.errors import CheckFailed, UsageError, quoted

if TYPE_CHECKING:
    from nacl.signing import SigningKey

    from heli3dof.report.text.table import Grid

Key = Annotated[
    Path | None,
    typer.Option("--key", metavar="FILE", help="The teacher's key; default: in your own folder."),
]
Sealed = Annotated[Path, typer.Argument(metavar="FILE", help="The exercise's sealed file.")]


def register(app: typer.Typer) -> None:
    verbs = {"new": new, "submit": submit, "mark": mark, "open": open_}
    help = "Make a rig with hidden effects for students; mark their answers."
    add_family(app, "exercise", verbs, help=help, heading="Teach")


@verb
def new(
    out: Output,
    level: Annotated[int, typer.Option("--level", min=1, max=5, help="1: easy … 5: hard.")],
    seed: Seed = 0,
    output: OutputFile = None,
    key: Key = None,
    force: Force = False,
) -> None:
    """Hide effects in an emulated rig: heli3dof exercise new --seed 7 --level 2."""
    from heli3dof.exercise.levels import LEVELS
    from heli3dof.exercise.teacher_key import default_key, new_key, seal
    from heli3dof.recording.atomic_write import check_outputs, write_file
    from heli3dof.rig.sealed_rig import check_nacl

    check_nacl()
    path, key_path = output or Path("rig.exercise"), key or default_key()
    check_outputs(path, force=force)
    made = not key_path.exists()
    if made:
        new_key(key_path)
        out.warn(
            f"a new teacher's key was written to {key_path}. Keep it from students and back it up: "
            "without it no answer can be marked"
        )
    exercise = seal(_key(out, key_path), seed, level)
    write_file(path, exercise.to_bytes(), force=force)
    out.show(f"Exercise {exercise.id}, level {level} ({LEVELS[level]}): {path}")
    out.note(f"Fly it: heli3dof run rich --device {quoted(f'mock:?exercise={path}&speed=max')}")
    out.emit(
        {
            "schema": "heli3dof.new_exercise/1",
            "exercise": exercise.id,
            "level": level,
            "file": str(path),
            "key": str(key_path),
            "key_is_new": made,
        }
    )


@verb
def submit(
    out: Output,
    diagnoses: Annotated[
        list[Path] | None,
        typer.Argument(metavar="DIAGNOSIS...", help="Output of diagnose --json."),
    ] = None,
    exercise: Annotated[
        Path, typer.Option("--exercise", metavar="FILE", help="The exercise's sealed file.")
    ] = Path("rig.exercise"),
    name: Annotated[str, typer.Option("--name", help="Your name, for the teacher.")] = "",
    cause: Annotated[
        list[str] | None,
        typer.Option(
            "--cause",
            metavar="NAME=VALUE±HALF",
            help="Your own claim: a hidden effect, its value and 95 % interval. The claim 'none' "
            "means that the rig has no hidden effect. Repeatable.",
        ),
    ] = None,
    confidence: Annotated[
        list[float] | None,
        typer.Option("--confidence", help="Probability (0 to 1) that a --cause is right."),
    ] = None,
    output: OutputFile = None,
    force: Force = False,
) -> None:
    """Write an answer to an exercise: heli3dof exercise submit diagnosis.json --name "Ada"."""
    from heli3dof.exercise.answer import make_answer, read_diagnosis, statements
    from heli3dof.recording.atomic_write import check_outputs, write_file
    from heli3dof.rig.sealed_rig import read_exercise

    path, files = output or Path("answer.json"), diagnoses or []
    if not files and not cause:
        raise UsageError(
            "There is nothing to submit.",
            cause="neither a diagnosis nor a --cause was given.",
            fix="heli3dof exercise submit diagnosis.json, or --cause none",
        )
    if not name.strip():
        raise UsageError(
            "The answer has no name.",
            cause="--name was omitted or is empty.",
            fix='--name "Ada Lovelace"',
        )
    check_outputs(path, force=force, inputs=[*files, exercise])
    own = statements(cause or [], confidence or [])
    documents = {str(file): read_diagnosis(file) for file in files}
    answer = make_answer(name.strip(), read_exercise(exercise), own, documents)
    write_file(path, answer.to_bytes(), force=force)
    for claim in answer.causes:
        out.show(f"  {claim.text()}")
    out.note(f"Answer to exercise {answer.exercise.id}: {path}")
    out.emit({**answer.model_dump(mode="json"), "file": str(path)})


@verb
def mark(
    out: Output,
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="The folder of the answers.")],
    key: Key = None,
) -> None:
    """Mark the answers of a class: heli3dof exercise mark answers/."""
    from heli3dof.exercise.marks import mark_folder
    from heli3dof.exercise.teacher_key import default_key

    answers = mark_folder(folder, _key(out, key or default_key()))
    documents = [answer.document() for answer in answers]
    marked_rows = {r["exercise"]: r for r in documents if r["reason"] is None}
    for exercise, row in sorted(marked_rows.items()):
        hidden = ", ".join(c["name"] for c in row["hidden"]) or "nothing"
        out.show(f"Exercise {exercise}, level {row['level']}, hides {hidden}.")
    out.show(_table(documents))
    marked = sum(answer.reason is None for answer in answers)
    out.note(f"Marked: {marked} of {len(answers)}")
    out.emit({"schema": "heli3dof.marks/1", "rows": documents})
    if not marked:
        raise typer.Exit(CheckFailed.exit_code)


@verb
def open_(out: Output, file: Sealed, key: Key = None) -> None:
    """Show the hidden effects of an exercise: heli3dof exercise open rig.exercise."""
    from heli3dof.exercise.teacher_key import default_key, open_truth
    from heli3dof.rig.sealed_rig import read_exercise

    exercise = read_exercise(file)
    truth = open_truth(_key(out, key or default_key()), exercise)
    out.show(f"Exercise {exercise.id}, level {exercise.level}:")
    for cause in truth.causes:
        values = ", ".join(f"{n} = {v:g}" for n, v in cause.values.items())
        out.show(f"  {cause.name}: {values}")
    if not truth.causes:
        out.show("  no hidden effect")
    if truth.spread:
        out.show(f"  K_f, gravity torque and inertias up to {100 * truth.spread:g} % off")
    out.emit(
        {
            "schema": "heli3dof.opened_exercise/1",
            "exercise": exercise.id,
            "level": exercise.level,
            "spread": truth.spread,
            "causes": [{"name": c.name, "parameters": dict(c.values)} for c in truth.causes],
        }
    )


def _key(out: Output, path: Path) -> SigningKey:
    """Load the teacher's key; warn if other users can read it."""
    from heli3dof.exercise.teacher_key import load_key, others_can_read

    key = load_key(path)
    if others_can_read(path):
        out.warn(f"other users can read the teacher's key: chmod 600 {quoted(path)}")
    return key


def _table(rows: list[dict[str, Any]]) -> Grid:
    """Return the table of the marks: a row per answer, in order of the students' names.

    If several answers have the same name, their files are named too.
    The column ``exercise`` is omitted if all answers are to one exercise.
    """
    from heli3dof.report.text.table import Grid

    seen = Counter(_same_name(row["name"]) for row in rows if row["reason"] is None)
    several = len({row["exercise"] for row in rows if row["exercise"]}) > 1
    heads = ("answer", "Brier", "RMSE roll/pitch/yaw", "names", "size error", "exercise")
    width = len(heads) if several else len(heads) - 1
    cells = []
    for row in sorted(rows, key=_order):
        marked = row["reason"] is None
        each = (
            _answer(row, seen) if marked else row["file"],
            _number(row["brier"]),
            _holdout(row["holdout_rmse_deg"]) if marked else "–",
            _names(row) if marked else f"not marked: {row['reason']}",
            _sizes(row),
            row["exercise"] or "–",
        )
        cells.append(each[:width])
    return Grid("Marks", heads[:width], cells, text_columns=1, prose_columns=width - 3)


def _order(row: dict[str, Any]) -> tuple[bool, str, str]:
    return row["reason"] is not None, _same_name(row["name"] or ""), row["file"]


def _answer(row: dict[str, Any], seen: Counter[str]) -> str:
    """Return the student's name, and the answer's file if other answers have the same name."""
    name = " ".join(row["name"].split())
    return name if seen[_same_name(name)] == 1 else f"{name}\n({row['file']})"


def _same_name(name: str) -> str:
    """Return ``name`` in lower case with single spaces, to compare two spellings of a name."""
    return " ".join(name.split()).casefold()


def _names(row: dict[str, Any]) -> str:
    """Return the marks of the causes that an answer names, as lines of text.

    The first line states how many of the hidden causes the answer names. A line ``wrong: NAME``
    follows for each effect that the answer names although it is not hidden. A line ``confounded:
    NAME`` follows for each hidden cause that the answer does not name as a cause, but lists as
    confounded with a wrong one.

    ``row``: one answer's marks, from `MarkedAnswer.document`.
    """
    lines = [f"{len(row['right'])} of {len(row['hidden'])}"]
    lines += [f"wrong: {name}" for name in row["wrong"]]
    lines += [f"confounded: {name}" for name in row["confounded"]]
    return "\n".join(lines)


def _sizes(row: dict[str, Any]) -> str:
    """Return the marks of the parameter values in an answer, one line of text for each value.

    A line states the relative error of a value, and whether the answer's 95 % interval of this
    value contains the true one: "12 %, inside".

    ``row``: one answer's marks, from `MarkedAnswer.document`.
    """
    where = {True: "inside", False: "outside", None: "no interval"}
    lines = [f"{100 * s['relative_error']:.0f} %, {where[s['inside']]}" for s in row["sizes"]]
    return "\n".join(lines) or "–"


def _holdout(errors: dict[str, float | None] | None) -> str:
    """Return the held-out RMSE of roll, pitch and yaw as text: ``0.20/–/0.09°``."""
    if not errors:
        return "–"
    return "/".join(_number(errors.get(axis)) for axis in AXES) + "°"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"
