"""Print a subcommand's results, progress and errors, for people and for scripts.

With ``--json`` exactly one JSON document goes to stdout and everything else to stderr. There is
no live display and no colour if stderr is not a terminal or ``NO_COLOR`` is set.
"""

from __future__ import annotations

import functools
import inspect
import json
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from heli3dof.cli.options import AsJson, Quiet
from heli3dof.cli.output_encoding import is_ascii_or_utf, lost_output, printable
from heli3dof.errors import Heli3dofError, UsageError, quoted
from heli3dof.json_values import jsonable
from heli3dof.write_errors import FULL, refusal

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.text import Text

INTERRUPTED = 130
TRACEBACK = "HELI3DOF_TRACEBACK"
"""Name of an environment variable: if it is set, an internal error prints its traceback."""


def live_allowed() -> bool:
    """Return True if a spinner may be shown: stderr is a terminal, and ``NO_COLOR`` is not set."""
    return sys.stderr.isatty() and not os.environ.get("NO_COLOR")


class Output:
    """Prints the results, notes, warnings and JSON document of one subcommand.

    ``as_json``: only one JSON document goes to stdout, all else to stderr. ``quiet``: results and
    notes are not printed. ``arguments``: names of the subcommand's parameters (`with_options`).
    """

    has_emitted = False
    """True once a JSON document was printed by this process"""

    def __init__(
        self, *, as_json: bool = False, quiet: bool = False, arguments: Sequence[str] = ()
    ) -> None:
        self.as_json, self.quiet, self.arguments = as_json, quiet, tuple(arguments)

    @functools.cached_property
    def err(self) -> Console:
        return _console(stderr=True, no_color=not live_allowed())

    @functools.cached_property
    def out(self) -> Console:
        if self.as_json:
            return self.err
        return _console(no_color=bool(os.environ.get("NO_COLOR")) or None)

    def show(self, *results: RenderableType) -> None:
        """Print tables or sentences on stdout, or on stderr if ``--json`` is given.

        Prints nothing if ``quiet``.
        """
        if not self.quiet:
            for each in results:
                self.out.print(each, soft_wrap=isinstance(each, str))

    def note(self, *texts: str) -> None:
        """Print sentences, such as "Written: rig.toml", on stderr. Print nothing if ``quiet``."""
        if not self.quiet:
            for text in texts:
                self.err.print(text, soft_wrap=True)

    def warn(self, *texts: str) -> None:
        """Print each sentence after "Warning: " on stderr, even with ``--quiet``."""
        for text in texts:
            warning = f"Warning: {with_options(text, self.arguments)}"
            self.err.print(warning, soft_wrap=True, style="yellow")

    def fail(self, *texts: str) -> None:
        """Print error messages on stderr, even with ``--quiet``."""
        for text in texts:
            self.err.print(text, soft_wrap=True, style="bold red")

    def emit(self, document: Mapping[str, Any]) -> None:
        """If ``--json`` is given, print ``document`` on stdout as JSON, with NaN as null."""
        if self.as_json:
            plain = jsonable(document)
            text = json.dumps(plain, ensure_ascii=False, indent=2, allow_nan=False)
            if not is_ascii_or_utf(text, getattr(sys.stdout, "encoding", None)):
                text = json.dumps(plain, indent=2, allow_nan=False)
            Output.has_emitted = True
            print(text)

    def print_error(self, error: Heli3dofError) -> None:
        """Print what happened, likely cause and fix on stderr; with ``--json`` also as JSON."""
        what, cause, fix = (
            with_options(text, self.arguments) for text in (error.what, error.cause, error.fix)
        )
        self.err.print(f"Error: {what}", soft_wrap=True, style="bold red")
        if cause:
            self.err.print(f"Likely cause: {cause}", soft_wrap=True)
        if fix:
            self.err.print(f"Try: {fix}", soft_wrap=True)
        self.emit_error(what, cause, fix, error.exit_code)

    def print_interruption(self, error: KeyboardInterrupt) -> None:
        """Print on stderr why the command was stopped; with ``--json`` also as JSON."""
        why = str(error) or "stopped with Ctrl-C"
        self.warn(why)
        self.emit_error(f"The command was {why}.", exit_code=INTERRUPTED)

    def emit_error(self, what: str, cause: str = "", fix: str = "", exit_code: int = 1) -> None:
        """If ``--json`` is given, print the JSON document of an error on stdout."""
        with suppress(OSError):  # the error may be that stdout cannot be written
            self.emit(
                {
                    "schema": "heli3dof.error/1",
                    "error": what,
                    "cause": cause,
                    "fix": fix,
                    "exit_code": exit_code,
                }
            )

    @contextmanager
    def working(self, text: str) -> Iterator[None]:
        """Context manager: show ``text`` with a spinner; without a terminal, print it as a line."""
        with stages(self) as stage:
            stage(text)
            yield


@contextmanager
def stages(out: Output) -> Iterator[Callable[[str], None]]:
    """Context manager: yield a function that displays the present stage of a computation.

    On a terminal, a spinner shows the text. If stderr is not a terminal, the function prints each
    text as a line, but leaves out counts such as "Screening … flights: 31 of 64". With ``--quiet``,
    the function shows nothing.
    """
    if out.quiet or not live_allowed():
        yield lambda sentence: None if "… " in sentence else out.note(sentence)
        return
    from rich.text import Text

    with out.err.status("Reading …") as status:
        yield lambda sentence: status.update(Text(sentence))


def _console(**options: Any) -> Console:
    """Return a console of the library rich; it prints unencodable characters as ASCII text.

    It prints ``[bold]`` and ``:smile:`` as they are: both may occur in names of files.
    """
    from rich.console import Console

    class Encoded(Console):
        def render_str(self, text: str, **how: Any) -> Text:
            return super().render_str(printable(text, self.encoding), **how)

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError  # rich would exit with the code 1

    return Encoded(highlight=False, markup=False, emoji=False, **options)


def verb(function: Callable[..., None]) -> Callable[..., None]:
    """Decorate a subcommand: give it the options --json and --quiet, and print its errors.

    The first argument of ``function``, ``out``, is an `Output` with these options. If ``function``
    raises an error, the command prints the error and exits with the error's exit code. The message
    states what happened, the likely cause and the fix.

    A message may refer to an argument of a Python function, such as ``order=4``. The command
    prints the corresponding option instead, such as ``--order 4`` (`with_options`).
    """

    @functools.wraps(function)
    def run(*args: Any, as_json: bool = False, quiet: bool = False, **options: Any) -> None:
        out = Output(as_json=as_json, quiet=quiet, arguments=[p.name for p in parameters])
        try:
            function(out, *args, **options)
        except typer.Exit:
            raise
        except KeyboardInterrupt as error:
            out.print_interruption(error)
            raise typer.Exit(INTERRUPTED) from None
        except BrokenPipeError:
            # The reader of stdout ended first, as `head` does.
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115
            raise typer.Exit(0) from None
        except Exception as error:
            explained = _explained(error)
            if explained is None:
                raise
            out.print_error(explained)
            raise typer.Exit(explained.exit_code) from error

    _, *parameters = inspect.signature(function, eval_str=True).parameters.values()
    last = [p for p in parameters if p.name == "verbose"]
    others = [p for p in parameters if p.name != "verbose"]
    run.__signature__ = inspect.Signature([*others, *COMMON, *last])  # type: ignore[attr-defined]
    return run


def add_family(
    app: typer.Typer,
    name: str,
    verbs: Mapping[str, Callable[..., None]],
    *,
    help: str,
    heading: str,
) -> None:
    """Add the subcommand ``name`` with subcommands of its own: ``verbs``, name → function.

    ``heading``: the heading under which ``heli3dof --help`` lists the subcommand ``name``.
    """
    family = typer.Typer(no_args_is_help=True, rich_markup_mode=None)
    for word, function in verbs.items():
        family.command(word)(function)
    app.add_typer(family, name=name, help=help, rich_help_panel=heading)


def _common_options(as_json: AsJson = False, quiet: Quiet = False) -> None:
    """Define the options ``--json`` and ``--quiet``, which `verb` adds to a subcommand."""


COMMON = tuple(inspect.signature(_common_options, eval_str=True).parameters.values())


def _explained(error: Exception) -> Heli3dofError | None:
    """Return ``error`` as a message with cause and fix; None if Python must print its traceback.

    Python prints the traceback of a bug if the environment variable `TRACEBACK` is set.
    """
    if isinstance(error, Heli3dofError):
        return error
    if isinstance(error, OSError) and (known := _explain_os_error(error)) is not None:
        return known
    if os.environ.get(TRACEBACK):
        return None
    return Heli3dofError(
        f"heli3dof failed: {type(error).__name__}: {error}",
        cause="an internal error (a bug in heli3dof).",
        fix=f"run it again with {TRACEBACK}=1, and report the traceback",
    )


def _explain_os_error(error: OSError) -> Heli3dofError | None:
    """Return a heli3dof error with cause and fix for ``error``; None if its reason is not known."""
    try:
        os.getcwd()
    except OSError:
        return UsageError(
            "The current folder does not exist any more.",
            cause="it was removed or renamed after this terminal entered it.",
            fix="cd to another folder",
        )
    if error.filename is None and error.errno in FULL:
        return lost_output(error)
    if not isinstance(error.filename, (str, bytes)):
        return None
    name = os.fsdecode(error.filename)
    if error.errno in FULL:
        return refusal(Path(name), error)
    return UsageError(
        f"{name} cannot be used: {error.strerror}.",
        cause="it is missing, belongs to another user, or is not a file of this kind.",
        fix=f"ls -ld {quoted(name)}",
    )


def with_options(text: str, arguments: Sequence[str]) -> str:
    """Return ``text`` with options in place of the ``arguments`` of a Python function.

    >>> with_options("add profile='RIG.toml', order=4 or force=True", ["profile", "order", "force"])
    'add --profile RIG.toml, --order 4 or --force'
    """

    def option(match: re.Match[str]) -> str:
        name, value = match[1].replace("_", "-"), match[2].strip("'")
        return f"--{name}" if value == "True" else f"--{name} {value}"

    if not arguments:
        return text
    return re.sub(rf"(?<![\w.?&:])({'|'.join(arguments)})=('[^']*'|\w+)", option, text)
