"""Replications of one diagnosis on an engine: the same numbers as on this computer."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from typing import Any

import pytest

from heli3dof.batch.engines import Lost
from heli3dof.batch.engines.replications import replications_on, replications_on_cluster
from heli3dof.diagnosis.diagnose import Effort, diagnose
from heli3dof.diagnosis.document import diagnosis_document
from heli3dof.errors import DeviceError
from heli3dof.parallel import distribute, replicate
from heli3dof.recording.load import load
from tests.paths import ROOT

STEP = ROOT / "recordings" / "step-roll-10.mcap"


class Elsewhere:
    """An engine with three workers that are this process; ``lost``: parts that they lose."""

    remote, workers = True, 3

    def __init__(self, *lost: int) -> None:
        self._lost = lost
        self.parts = 0

    def __enter__(self) -> Elsewhere:
        return self

    def __exit__(self, *error: object) -> None: ...

    def run(self, work: Callable[[Any], Any], items: Iterable[Any]) -> Generator[tuple[int, Any]]:
        for n, item in reversed(list(enumerate(items))):
            self.parts += 1
            yield n, Lost("killed") if n in self._lost else work(item)


def document() -> dict[str, Any]:
    """Of the step alone: it has base fit, nulls, a cause and the torque search."""
    made = diagnosis_document(diagnose(load(STEP).between(6.0, 16.0), quick=True))
    made["about"].pop("seconds")
    return made


def test_a_diagnosis_has_the_same_numbers_on_an_engine(monkeypatch: pytest.MonkeyPatch) -> None:
    """All functions of replications are picklable; few replications, so that it is fast."""
    pytest.importorskip("cloudpickle")
    monkeypatch.setattr("heli3dof.diagnosis.diagnose.QUICK", Effort(6, 8, 3, 6))
    engine = Elsewhere()
    with distribute(replications_on(engine)):
        elsewhere = document()
    assert engine.parts >= 9
    assert elsewhere["findings"]
    assert elsewhere == document()


def test_lost_replications_are_computed_here() -> None:
    pytest.importorskip("cloudpickle")
    with distribute(replications_on(Elsewhere(0))):
        assert replicate(lambda i: i * i, 8) == [i * i for i in range(8)]


def test_a_cluster_out_of_reach_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("heli3dof.batch.engines.dask_cluster.ANSWER_S", 0.5)
    with (
        pytest.raises(DeviceError, match="does not answer"),
        replications_on_cluster("tcp://127.0.0.1:9"),
    ):
        pass
