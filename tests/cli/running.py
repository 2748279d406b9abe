"""Run the command line in this process and return its exit code and output."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from functools import cache
from typing import Any

import typer.testing
from typer.main import get_command

from heli3dof.cli.app import app
from heli3dof.rig.session.stop_stamp import start_command

# The parser is built once: 40 ms of CPU time, a thousand times in the tests.
typer.testing._get_command = cache(get_command)


class Utf8(io.StringIO):
    """Text in memory that says that it is encoded in UTF-8."""

    encoding = "utf-8"


@dataclass(frozen=True)
class Result:
    """Exit code, stdout and stderr of a command."""

    code: int
    out: str
    err: str

    @property
    def document(self) -> dict[str, Any]:
        """The JSON document on stdout; fails if stdout contains anything else."""
        loaded = json.loads(self.out)
        assert isinstance(loaded, dict)
        return loaded


def heli3dof(*words: object) -> Result:
    """``heli3dof words...``"""
    start_command()
    result = typer.testing.CliRunner().invoke(app, [str(w) for w in words])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return Result(result.exit_code, result.stdout, result.stderr)
