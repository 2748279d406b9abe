"""Memory of a flight as it goes on: half an hour of flight in half a minute.

The emulated rig flies as fast as possible, recorded to a file. The memory is read in flight, each
time after the recorder has written all rows.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.control_loop.loop import fly
from heli3dof.experiment.control_loop.outcome import Outcome
from heli3dof.experiment.fly import prepare
from heli3dof.experiment.plan import step_plan
from heli3dof.experiment.safety_monitors import monitors_for
from heli3dof.recording.mcap_files.flight_recorder import RecordingWriter
from heli3dof.recording.provenance import provenance
from heli3dof.rig.profile import Profile, default_profile, profile_from_dict
from heli3dof.rig.session.open_exclusive import open_rig
from tests.experiment.safety_monitors.periods import Judging
from tests.profiles import END_S

DEVICE = "mock:?speed=max&start=level"
SETTLE_S = 5.0
READINGS = 10
"""Readings at each row, of which the smallest is used"""


def read_in_flight(
    path: Path,
    rows: int,
    at: Sequence[int],
    held: Callable[[], float],
    *,
    begin: Callable[[], object] = lambda: None,
    monitors: Sequence[Callable[[Period], object]] = (),
) -> tuple[list[float], Outcome]:
    """``held()`` at the rows ``at`` of a flight of ``rows``, and the flight's outcome.

    ``begin`` is called at the first row; ``monitors``: in addition to the flight's own.
    """
    profile = patient()
    plan = step_plan((5, None, None), settle_s=SETTLE_S, duration_s=rows * profile.dt - SETTLE_S)
    signals = prepare(plan, profile, 0)
    readings: list[float] = []
    due = {k: i for i, k in enumerate(at)}
    with (
        open_rig(DEVICE, profile) as rig,
        RecordingWriter(path, profile, provenance(source="flight", identity=rig.identity)) as file,
    ):

        def read(now: Period) -> str | None:
            if now.k == 0:
                begin()
            if now.k in due:
                until_written(file, now.k)
                readings.append(min(rested(held)))
            return None

        outcome = fly(
            rig, profile, signals, file,
            monitors=(*monitors_for(profile), *map(Judging, (*monitors, read))),
        )  # fmt: skip
        file.outcome(outcome.ending, **outcome.details())
    return readings, outcome


def until_written(file: RecordingWriter, rows: int, patience_s: float = END_S) -> None:
    """Wait until the recorder has written so many rows."""
    last = time.monotonic() + patience_s
    while file._file.row_count < rows and time.monotonic() < last:
        time.sleep(0.002)


def rested(held: Callable[[], float]) -> Iterator[float]:
    """Readings while the loop waits, and the recorder frees what it has written."""
    for _ in range(READINGS):
        time.sleep(0.01)
        yield held()


def patient() -> Profile:
    """The paper's rig without a limit on the duration of a flight."""
    data = default_profile().to_dict()
    data["limits"] |= {"duration_max_s": 1e6}
    return profile_from_dict(data).with_controller()
