"""The command line ``heli3dof VERB``: collects the verbs (its subcommands) and runs one.

A verb is a module of this folder with a function ``register(app)``. Other packages register such
functions in the entry point group ``heli3dof.verbs``. `register` adds the verb to ``app`` and
states its heading in ``heli3dof --help``: ``app.command("run", rich_help_panel="Fly")(run)``.
Verbs import heavy libraries inside their functions, so that ``heli3dof --help`` is quick.
"""

from __future__ import annotations

import difflib
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from typing import Annotated, Any

import typer
from typer.core import TyperGroup
from typer.main import get_group

from heli3dof.cli import output_encoding
from heli3dof.cli.estop import estop_without_typer
from heli3dof.cli.output import Output
from heli3dof.plugins import modules_of, use_plugins

GROUP = "heli3dof.verbs"
ParserError: Any = typer.BadParameter.__base__
"""Class of the option parser's errors, which typer does not export"""
FAMILIES = ("Fly", "Model", "Files", "Many recordings", "Plans and rigs", "Teach")
"""Headings of ``heli3dof --help`` in order; other headings follow after them"""
MORE = "More"
"""Heading of the verbs that state no heading"""


def _family(command: Any) -> str:
    """Return the heading under which ``--help`` lists a subcommand; `MORE` if it has none."""
    panel = getattr(command, "rich_help_panel", None)
    return panel if isinstance(panel, str) else MORE  # typer's default is a placeholder


class Verbs(TyperGroup):
    """Typer command group. Its ``--help`` lists the subcommands by heading, sorted by name.

    With ``--json``, an error of the option parser is also printed as a JSON document on stdout.
    """

    def main(self, args: Sequence[str] | None = None, *more: Any, **how: Any) -> Any:
        words = sys.argv[1:] if args is None else list(args)
        try:
            return super().main(args, *more, **how)
        except SystemExit as end:
            error = end.__context__  # what made typer end the command
            cause = getattr(error, "__cause__", None)
            if isinstance(cause, KeyboardInterrupt):
                raise cause from None
            if isinstance(error, ParserError):
                where, out = getattr(error, "ctx", None), Output(as_json="--json" in words)
                out.note(*self._hints(error, words))
                out.emit_error(
                    error.format_message(),
                    "an option or an argument is misspelt, missing or out of range.",
                    f"{where.command_path if where else 'heli3dof'} --help",
                    error.exit_code,
                )
            raise

    def _hints(self, error: Any, words: Sequence[str]) -> Iterator[str]:
        """Yield sentences that help to correct an error of the option parser."""
        verb = next((w for w in words if w in self.commands), None)
        if verb is None or error.ctx is None:
            return
        if error.ctx.parent is None:
            if "No such option" in error.format_message():
                yield f"Options follow the verb: heli3dof {verb} --help lists them"
            return
        if re.search("valid (number|float)", error.format_message()):  # typer's words
            yield "A number has a decimal point and no unit."
        help_text = error.ctx.command.help or ""
        example = re.search(rf"heli3dof {verb}\b.*?(?=\.?$|, or )", help_text, re.M)
        if example:
            yield f"Example: {example[0]}"

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return a subcommand's name, the subcommand and its arguments.

        ``args``: the subcommand's name and its arguments. If no subcommand has this name, the error
        suggests the subcommands whose help text contains the name as a word. If there are none, the
        error suggests the subcommands with a similar name.
        """
        word = args[0]
        if word not in self.commands and not word.startswith("-"):
            mention = re.compile(rf"\b{re.escape(word)}\b", re.I)
            meant = [n for n in self.list_commands(ctx) if mention.search(self._short_help(n))]
            meant = meant or difflib.get_close_matches(word, self.commands, cutoff=0.7)
            hint = f" Did you mean {' or '.join(map(repr, meant))}?" if meant else ""
            ctx.fail(f"No such command {word!r}.{hint}")
        return super().resolve_command(ctx, args)

    def _short_help(self, name: str) -> str:
        return str(self.commands[name].get_short_help_str(limit=200)).partition(":")[0]

    def list_commands(self, ctx: Any) -> list[str]:
        def rank(verb: str) -> tuple[int, bool, str, str]:
            family = _family(self.commands[verb])
            known = FAMILIES.index(family) if family in FAMILIES else len(FAMILIES)
            return known, family == MORE, family, verb

        return sorted(self.commands, key=rank)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        for family, names in groupby(self.list_commands(ctx), lambda n: _family(self.commands[n])):
            with formatter.section(family):
                formatter.write_dl(
                    [(n, self.commands[n].get_short_help_str(limit=200)) for n in names]
                )


app = typer.Typer(
    name="heli3dof",
    cls=Verbs,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # rich's help takes twice as long to load as everything else
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"heli3dof {version('heli3dof')}")
        raise typer.Exit


@app.callback()
def _start(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Fly, identify, compare and diagnose a 3-DOF helicopter. Start with: heli3dof demo"""


def _register_all() -> None:
    for module in modules_of("heli3dof.cli"):
        if hasattr(module, "register"):
            module.register(app)

    def add(register: Callable[[typer.Typer], None]) -> None:
        own = typer.Typer()
        register(own)
        if taken := get_group(own).commands.keys() & get_group(app).commands.keys():
            raise ValueError(f"there is a verb {min(taken)!r} already")
        app.registered_commands += own.registered_commands
        app.registered_groups += own.registered_groups

    use_plugins(GROUP, "verb", add)


_register_all()


def main() -> None:
    """Run the subcommand named in ``sys.argv``, and end the process with its exit code."""
    # Before numpy is imported. Our matrices are small: several BLAS threads gain nothing, and on
    # a busy machine they wait for each other, which made an identification ten times slower.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    output_encoding.prepare()
    try:
        if sys.argv[1:2] == ["estop"]:
            estop_without_typer(sys.argv[2:])
        app()
    except SystemExit as end:
        code = 0 if output_encoding.reader_has_gone(end) else end.code
    except OSError as error:  # of --help; a verb explains its own errors
        code = output_encoding.print_lost_output(error)
    sys.exit(output_encoding.finish(code))
