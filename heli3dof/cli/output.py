"""What a verb says and where: results, progress and errors, for people or for scripts.

With ``--json`` exactly one JSON document goes to stdout and everything else to stderr. There is
no live display and no colour where stderr is not a terminal or ``NO_COLOR`` is set.
"""

from __future__ import annotations

import functools
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec

import typer

from heli3dof.cli.output_encoding import carries, printable
from heli3dof.errors import Heli3dofError, NoSpace, UsageError
from heli3dof.write_errors import FULL, refusal

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.text import Text

P = ParamSpec("P")
INTERRUPTED = 130
TRACEBACK = "HELI3DOF_TRACEBACK"
"""Set in the environment, it shows where a fault of ours happened."""


def live_allowed() -> bool:
    """True where a progress bar may move: a terminal that does not refuse it."""
    return sys.stderr.isatty() and not os.environ.get("NO_COLOR")


class Talk:
    """The voice of one verb: ``show`` results, ``note`` asides, ``emit`` the JSON document."""

    def __init__(self, *, as_json: bool = False, quiet: bool = False) -> None:
        self.as_json, self.quiet = as_json, quiet

    @functools.cached_property
    def err(self) -> Console:
        return _console(stderr=True, no_color=not live_allowed())

    @functools.cached_property
    def out(self) -> Console:
        if self.as_json:
            return self.err
        return _console(no_color=bool(os.environ.get("NO_COLOR")) or None)

    def show(self, *what: RenderableType) -> None:
        """A result: a table or a sentence."""
        if not self.quiet:
            for each in what:
                self.out.print(each, soft_wrap=isinstance(each, str), markup=False)

    def note(self, text: str) -> None:
        """An aside on stderr: where a file went, what was assumed."""
        if not self.quiet:
            self.err.print(text, soft_wrap=True, markup=False)

    def warn(self, text: str) -> None:
        """A warning on stderr, even when quiet."""
        self.err.print(f"Warning: {text}", soft_wrap=True, markup=False, style="yellow")

    def fail(self, text: str) -> None:
        """A line on stderr, even when quiet: what did not hold."""
        self.err.print(text, soft_wrap=True, markup=False, style="bold red")

    def emit(self, document: Mapping[str, Any]) -> None:
        """The one JSON document, when asked for: UTF-8, or ASCII where the stream is not UTF-8."""
        if self.as_json:
            plain = jsonable(document)
            text = json.dumps(plain, ensure_ascii=False, indent=2, allow_nan=False)
            if not carries(text, getattr(sys.stdout, "encoding", None)):
                text = json.dumps(plain, indent=2, allow_nan=False)
            print(text)

    @contextmanager
    def working(self, text: str) -> Iterator[None]:
        """A spinner for something that takes over a second."""
        if self.quiet or not live_allowed():
            if not self.quiet:
                self.note(text)
            yield
            return
        with self.err.status(text):
            yield


def _console(**options: Any) -> Console:
    """A console whose columns fit what its encoding makes of the text."""
    from rich.console import Console

    class Encoded(Console):
        def render_str(self, text: str, **how: Any) -> Text:
            return super().render_str(printable(text, self.encoding), **how)

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError  # rich would end the process with 1

    return Encoded(highlight=False, **options)


def jsonable(value: Any) -> Any:
    """Plain JSON types; what is not a finite number becomes null."""
    if isinstance(value, Mapping):
        return {str(k): jsonable(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [jsonable(v) for v in value]
    if hasattr(value, "tolist"):
        return jsonable(value.tolist())
    if isinstance(value, float):
        return value if value == value and abs(value) != float("inf") else None
    if isinstance(value, (str, int, bool)) or value is None:
        return value
    if isinstance(value, complex):
        return {"re": jsonable(value.real), "im": jsonable(value.imag)}
    return str(value)


def verb(function: Callable[P, None]) -> Callable[P, None]:
    """Turn our errors into three sentences on stderr and the contract's exit code."""

    @functools.wraps(function)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        try:
            function(*args, **kwargs)
        except Heli3dofError as error:
            report(error, as_json=bool(kwargs.get("as_json")))
            raise typer.Exit(error.exit_code) from None
        except KeyboardInterrupt:
            Talk().warn("stopped with Ctrl-C")
            raise typer.Exit(INTERRUPTED) from None
        except BrokenPipeError:
            # Whoever read our output has gone, as `| head` does; that is no fault.
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115
            raise typer.Exit(0) from None
        except Exception as error:
            if isinstance(error, typer.Exit):
                raise
            if isinstance(error, OSError) and (refused := _by_the_system(error)) is not None:
                report(refused, as_json=bool(kwargs.get("as_json")))
                raise typer.Exit(refused.exit_code) from None
            if os.environ.get(TRACEBACK):
                raise
            fault = Heli3dofError(
                f"heli3dof failed: {type(error).__name__}: {error}",
                cause="a fault of ours.",
                fix=f"{TRACEBACK}=1 heli3dof … shows where; please report it",
            )
            report(fault, as_json=bool(kwargs.get("as_json")))
            raise typer.Exit(fault.exit_code) from error

    return run


def _by_the_system(error: OSError) -> Heli3dofError | None:
    """Our error for the system's, where it is about a file or the current folder."""
    try:
        os.getcwd()
    except OSError:
        return UsageError(
            "The current folder does not exist any more.",
            cause="it was removed or renamed after this terminal entered it.",
            fix="cd to another folder",
        )
    if error.filename is None and error.errno in FULL:
        return NoSpace(
            f"The output cannot be written: {error.strerror}.",
            cause="the disk that it was sent to is full.",
            fix="df -h; what the verb wrote to files of its own is whole",
        )
    if not isinstance(error.filename, (str, bytes)):
        return None
    name = os.fsdecode(error.filename)
    if error.errno in FULL:
        return refusal(Path(name), error)
    return UsageError(
        f"{name} cannot be used: {error.strerror}.",
        cause="it is missing, belongs to someone else, or is of another kind.",
        fix=f"ls -ld {name}",
    )


def report(error: Heli3dofError, *, as_json: bool) -> None:
    """An error: what happened, the likely cause, what to do."""
    talk = Talk(as_json=as_json)
    talk.err.print(f"Error: {error.what}", soft_wrap=True, markup=False, style="bold red")
    if error.cause:
        talk.err.print(f"Likely cause: {error.cause}", soft_wrap=True, markup=False)
    if error.fix:
        talk.err.print(f"Try: {error.fix}", soft_wrap=True, markup=False)
    with suppress(OSError):  # the error may be that nothing can be written there
        talk.emit(
            {
                "schema": "heli3dof.error/1",
                "error": error.what,
                "cause": error.cause,
                "fix": error.fix,
                "exit_code": error.exit_code,
            }
        )
