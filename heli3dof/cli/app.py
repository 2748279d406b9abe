"""The command line ``heli3dof VERB``: collects the verbs (its subcommands) and runs one.

A verb is a module of this folder with a function ``register(app)``, or such a function of another
package in the entry point group ``heli3dof.verbs``. Verbs import heavy libraries inside their
functions, so that ``heli3dof --help`` is quick.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
import sys
from typing import Any

import typer
from typer.core import TyperGroup

from heli3dof import cli
from heli3dof.cli import output_encoding
from heli3dof.cli.estop import estop_without_typer
from heli3dof.plugins import use_plugins

GROUP = "heli3dof.verbs"
FAMILIES = {
    "Fly": ("demo", "run-step", "run", "simulate"),
    "Model": ("identify", "compare", "diagnose", "report"),
    "Files": ("import", "export", "info", "recover"),
    "Plans and rigs": ("plans", "devices", "doctor", "zero", "monitor", "estop", "profile"),
}
"""Headings and verbs of ``heli3dof --help`` in order; any other verb is listed under `MORE`"""
MORE = "More"


class Verbs(TyperGroup):
    """Command group whose help lists the verbs by `FAMILIES`."""

    def list_commands(self, ctx: Any) -> list[str]:
        order = [verb for family in FAMILIES.values() for verb in family]
        rank = {verb: i for i, verb in enumerate(order)}
        return sorted(self.commands, key=lambda verb: (rank.get(verb, len(order)), verb))

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        rows: dict[str, list[tuple[str, str]]] = {}
        for name in self.list_commands(ctx):
            family = next((f for f, verbs in FAMILIES.items() if name in verbs), MORE)
            help_text = self.commands[name].get_short_help_str(limit=200)
            rows.setdefault(family, []).append((name, help_text))
        for family, listed in rows.items():
            with formatter.section(family):
                formatter.write_dl(listed)


app = typer.Typer(
    name="heli3dof",
    cls=Verbs,
    help="Fly, identify, compare and diagnose a 3-DOF helicopter. Start with: heli3dof demo",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # rich's help takes twice as long to load as everything else
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _register_all() -> None:
    for module in pkgutil.iter_modules(cli.__path__):
        if module.name != "app":
            found = importlib.import_module(f"{cli.__name__}.{module.name}")
            if hasattr(found, "register"):
                found.register(app)
    use_plugins(GROUP, "verb", lambda register: register(app))


_register_all()


def main() -> None:
    """Run the command line and exit with its code: the entry point of ``heli3dof``."""
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
        code = output_encoding.lost(error)
    sys.exit(output_encoding.finish(code))
