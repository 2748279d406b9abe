"""Renamed options: a command accepts the former name for one version, with a warning.

::

    app.command("devices", cls=renamed({"--ask": "--probe"}))(devices)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import typer
from typer.core import TyperCommand


def renamed(options: Mapping[str, str]) -> type[TyperCommand]:
    """Return a typer command class; ``options`` maps former option names to the present ones."""

    class Command(TyperCommand):
        def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
            return super().parse_args(ctx, [_present_name(word, options) for word in args])

    return Command


def _present_name(word: str, options: Mapping[str, str]) -> str:
    name, equals, value = word.partition("=")
    if name not in options:
        return word
    typer.echo(
        f"Warning: {name} is now {options[name]}; the next version no longer accepts {name}.",
        err=True,
    )
    return f"{options[name]}{equals}{value}"
