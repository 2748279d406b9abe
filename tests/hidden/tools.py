"""The tools under test: our diagnosis, and the peers on the same flights. Each returns a document.

A tool is a function from a blind recording to a document of the contract, as far as the tool can
fill it, and the files that its result depends on.
"""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.recording.recording import Recording
from tests.hidden import rules
from tests.paths import ROOT

PEERS_PYTHON = ROOT / ".venv-peers" / "bin" / "python"
TIME_LIMIT_S = 300
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
Document = dict[str, Any]

FLIES = (
    "drivers", "heli3dof/experiment", "heli3dof/recording", "heli3dof/rig",
    "heli3dof/model/control/controller.py", "tests/hidden/sizes.py", "tests/hidden/cases.py",
    "tests/hidden/other_rigs.py", "tests/hidden/rig_cases.py", "tests/hidden/third_cases.py",
    "tests/hidden/third_plant",
)  # fmt: skip
"""Files and folders that every flight depends on."""


@dataclass(frozen=True)
class Tool:
    """A row of the table; ``code`` lists the files and folders of the tool.

    ``takes_holdout``: ``ask`` has a second argument, the hold-out recording of the case, if any.
    """

    title: str
    ask: Callable[..., Document]
    code: tuple[str, ...]
    takes_holdout: bool = False

    @property
    def missing(self) -> str:
        """Reason why the tool cannot run here, or an empty string."""
        if self.ask is pysindy and not PEERS_PYTHON.exists():
            return "its environment is missing: run make bench-peers"
        return ""


def whole(recording: Recording, holdout: Recording | None = None) -> Document:
    return _ours(recording, holdout, quick=False)


def quick(recording: Recording, holdout: Recording | None = None) -> Document:
    return _ours(recording, holdout, quick=True)


def _ours(recording: Recording, holdout: Recording | None, *, quick: bool) -> Document:
    from heli3dof.diagnosis.diagnose import diagnose
    from heli3dof.diagnosis.document import diagnosis_document

    # Through JSON text, as another program would read it.
    diagnosis = diagnose(recording, holdout, quick=quick)
    return dict(json.loads(json.dumps(diagnosis_document(diagnosis))))


def residuals(recording: Recording) -> Document:
    from tests.hidden.residual_test import document

    return document(recording)


def pysindy(recording: Recording) -> Document:
    """The flight without take-off and landing, in a process of the peers' environment."""
    from tests.bench.peers import flights
    from tests.bench.peers.interface import Task, write_task

    flown = recording.rows(longest(in_flight(recording)))
    task = Task(
        flown.t, flown.voltage, flown.angle, flights.nominal(), flights.known(),
        np.abs(flown.profile.encoder.rad_per_count), np.ones(3),
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        given, result = Path(folder) / "task.npz", Path(folder) / "found.json"
        write_task(given, task)
        done = subprocess.run(
            [str(PEERS_PYTHON), "-m", "tests.bench.peers.pysindy_discrepancy", given, result],
            cwd=ROOT, env={**os.environ, **ONE_THREAD}, capture_output=True, text=True,
            timeout=TIME_LIMIT_S,
        )  # fmt: skip
        if done.returncode:
            raise RuntimeError(done.stderr.strip().splitlines()[-1])
        return dict(json.loads(result.read_text(encoding="utf-8")))


def in_flight(recording: Recording) -> np.ndarray:
    """(N,) bool. Late and lost samples leave nothing out: a peer may interpolate."""
    from heli3dof.identification.row_selection import unusable

    return ~np.any(list(unusable(recording).values()), axis=0)


def longest(rows: np.ndarray) -> slice:
    """The longest stretch of rows that are all true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]])))
    starts, stops = edges[::2], edges[1::2]
    i = int((stops - starts).argmax())
    return slice(int(starts[i]), int(stops[i]))


RULES = ("heli3dof", "tests/hidden/rules.py")
TOOLS = {
    "whole": Tool("**heli3dof diagnose**", whole, ("heli3dof",), takes_holdout=True),
    "quick": Tool("**heli3dof diagnose --quick**", quick, ("heli3dof",), takes_holdout=True),
    "pysindy": Tool(
        "PySINDy, discrepancy recipe", pysindy,
        ("heli3dof/identification/row_selection.py", "tests/hidden/tools.py",
         *(f"tests/bench/peers/{name}.py" for name in
           ("flights", "interface", "pysindy_discrepancy", "pysindy_library", "rigid")),
         "constraints-peers.txt"),
    ),
    "residuals": Tool(
        "residual test (whiteness, past inputs)", residuals,
        ("heli3dof/identification", "heli3dof/model", "tests/hidden/residual_test.py"),
    ),
    "rules": Tool("diagnose, with the rules noted", rules.traced, RULES, takes_holdout=True),
    **{
        f"without {name}": Tool(
            f"without: {name}", partial(rules.without, name), RULES, takes_holdout=True
        )
        for name in rules.BY_NAME
    },
}  # fmt: skip
