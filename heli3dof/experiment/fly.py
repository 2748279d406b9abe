"""A whole flight: check the plan, open the rig, fly, record, and report how it ended."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from heli3dof.errors import (
    DeviceError,
    Heli3dofError,
    RecordingError,
    SafetyTrip,
    UsageError,
    quoted,
)
from heli3dof.experiment.control_loop.loop import Live, fly
from heli3dof.experiment.control_loop.outcome import Outcome
from heli3dof.experiment.control_loop.signal_handling import StopSignals, stop_signals
from heli3dof.experiment.plan import Plan, Signals, checked
from heli3dof.experiment.safety_monitors import monitors_for
from heli3dof.model.control.stability import check_hover_loop
from heli3dof.recording.atomic_write import check_ending
from heli3dof.recording.mcap_files.flight_recorder import RecordingWriter
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.memory import MemoryRecorder
from heli3dof.recording.provenance import provenance, seeds
from heli3dof.recording.recording import Recording
from heli3dof.recording.row import RowSink
from heli3dof.rig.drivers import is_private, seed_of, with_seed
from heli3dof.rig.interface import Identity
from heli3dof.rig.profile import Profile, default_profile
from heli3dof.rig.session.open_exclusive import open_rig
from heli3dof.rig.session.stop_stamp import command_began_ns
from heli3dof.rig.session.stoppable_rig import StoppableRig
from heli3dof.rig.trip import Trip

ON_REQUEST = "emergency stop on request"


@dataclass(frozen=True, eq=False, repr=False)
class Flight:
    """Result of a flight: recording, outcome, and the file's path (None: recorded in memory)."""

    recording: Recording
    outcome: Outcome
    path: Path | None

    def __repr__(self) -> str:
        ended = ": ".join(x for x in (self.outcome.ending, str(self.outcome.detail or "")) if x)
        return f"<Flight of {self.recording.name!r}, {ended},\n file: {self.path or 'none'}>"

    def raise_if_cut_short(self) -> None:
        """Raise an exception if the flight did not complete its plan; else do nothing.

        The exception is SafetyTrip after a safety trip, and KeyboardInterrupt after a stop signal
        such as Ctrl-C. Otherwise it is the DeviceError or Heli3dofError that ended the flight. A
        Heli3dofError may have another exception as its cause. The recording is kept in any case.
        """
        self.raise_ending(self.outcome, self.path)

    @staticmethod
    def raise_ending(outcome: Outcome, path: Path | None) -> None:
        """Raise an exception if the flight with this outcome did not complete its plan.

        `raise_if_cut_short` lists the exceptions. ``path``: the recording's file, for the
        exceptions' messages; None: no file.
        """
        is_gone = path is not None and not path.exists()
        kept = f"; the recording is kept in {path}" if path else ""
        if is_gone:
            kept = f"; the recording was moved or deleted in flight: it is no longer at {path}"
        if outcome.ending == "interrupted":
            raise KeyboardInterrupt(f"{outcome.detail}{kept if is_gone else ''}")
        if outcome.ending == "tripped":
            advice = outcome.advice()
            look = f"heli3dof report {quoted(path)}" if path else "look at flight.recording"
            ended = "was ended" if outcome.periods else "did not begin,"
            raise SafetyTrip(
                f"The flight {ended} for safety: {outcome.detail}{kept}.",
                cause=advice.get("likely_cause") or "not known.",
                fix=advice.get("fix") or look,
            )
        if outcome.ending == "device":
            assert isinstance(outcome.error, DeviceError)
            if is_gone:
                outcome.error.what += f" The flight ended{kept}."
            raise outcome.error
        if outcome.ending == "error":
            if isinstance(outcome.error, Heli3dofError):
                raise outcome.error
            raise Heli3dofError(
                f"An internal error ended the flight: {outcome.detail}{kept}.",
                cause="a bug in heli3dof or in the rig's driver.",
                fix="report it, with the recording",
            ) from outcome.error


FIXED_META = frozenset({"source", "plan", "seed", "seeds", "identity", "device", "rest"})
"""Keys of a recording's provenance that the argument ``meta`` of `fly_plan` cannot replace"""


def prepare(plan: Plan, profile: Profile, seed: int) -> Signals:
    """Check the plan and the controller's gain; return the plan's signals.

    Raises PlanError, or UnstableLoop if the gain does not stabilise the profile's hover model.
    """
    signals = checked(plan, profile, seed)
    check_hover_loop(profile)
    return signals


def fly_plan(
    plan: Plan,
    *,
    device: str = "mock:?speed=max",
    profile: Profile | None = None,
    seed: int = 0,
    output: str | Path | None = None,
    force: bool = False,
    meta: Mapping[str, Any] | None = None,
    live: Live | None = None,
    opened: Callable[[Identity], None] = lambda identity: None,
    warn: Callable[[str], None] = lambda text: None,
) -> Flight:
    """Fly a plan on a rig and record it (to the file ``output``, or in memory).

    ``device``: the rig's URL; default: the emulated rig. A real rig flies only if its URL is given:
    the function neither searches for rigs nor reads HELI3DOF_DEVICE.

    ``seed``: seed of the plan's random signals, and of an emulated rig's noise if its URL has no
    seed. ``force`` overwrites the file; ``meta`` is added to the recording's metadata; ``live``
    receives the progress. Before arming the rig, the function calls ``opened`` with the rig's
    identity, and ``warn`` with each warning.

    Returns the flight even if it did not complete its plan. In these cases the function raises an
    exception instead:

    - The flight ended before its first row was recorded: the exception that
      `Flight.raise_if_cut_short` raises for such an ending.
    - The file ``output`` was moved or deleted in flight: RecordingError if the plan was completed,
      else the exception of `Flight.raise_if_cut_short`.
    - The flight did not start: PlanError, UnstableLoop, DeviceError, OutputExists or UsageError.
    - An emergency stop was requested before the rig was armed: SafetyTrip. In a script or program,
      every stop since the program's start counts. In an interactive interpreter, only a stop since
      this call counts (`heli3dof.rig.session.stop_stamp`).
    """
    began_ns = command_began_ns()
    if fixed := sorted(FIXED_META & (meta or {}).keys()):
        raise UsageError(
            f"meta has the key {fixed[0]!r}, which the flight itself sets.",
            cause="heli3dof records plan, seeds, rig and device of the flight under their names.",
            fix=f"another key, such as {'own_' + fixed[0]!r}",
        )
    if output is not None:
        check_ending(Path(output), ".mcap")
        if Path(output).suffix.lower() != ".mcap":
            warn(f"{output} will be an MCAP recording; usually its name ends in .mcap.")
    profile = (profile or default_profile()).with_controller()
    signals = prepare(plan, profile, seed)
    for text in signals.warnings(profile):
        warn(text)
    device = with_seed(device, seed)
    live = live or Live()
    with open_rig(device, profile, also=lambda: _progress(live), began_ns=began_ns) as rig:
        opened(rig.identity)
        if rig.rest.note:
            warn(rig.rest.note)
        about = provenance(
            source="flight",
            plan=plan.to_dict(),
            **seeds(seed, seed_of(device), plan_draws=signals.drawn),
            identity=rig.identity,
            device=device,
            rest=None if is_private(device) else rig.rest.to_dict(),
            warnings=[rig.rest.note] if rig.rest.note else None,
            **{"name": Path(output).stem if output else plan.name, **(meta or {})},
        )
        path = None if output is None else Path(output)
        return _fly_and_record(rig, profile, signals, about, live, path, force=force)


def _fly_and_record(
    rig: StoppableRig,
    profile: Profile,
    signals: Signals,
    meta: Mapping[str, Any],
    live: Live,
    path: Path | None = None,
    *,
    force: bool = False,
) -> Flight:
    """Fly, record to the file ``path`` (None: in memory), and return the flight.

    If the flight ends before the first row is recorded, raises the exception that states why.
    """
    # Signals are caught until the recording is closed, so that none of them leaves it incomplete.
    with stop_signals() as received, ExitStack() as closing:
        sink: MemoryRecorder | RecordingWriter = MemoryRecorder()
        if path is not None:
            sink = closing.enter_context(RecordingWriter(path, profile, meta, force=force))
        outcome = _fly(rig, profile, signals, sink, received, live)
        if isinstance(sink, RecordingWriter):
            sink.outcome(outcome.ending, **outcome.details())
    if not sink.rows:
        Flight.raise_ending(outcome, path)
    if path is not None:
        if not path.exists():
            Flight.raise_ending(outcome, path)
            raise RecordingError(
                f"The flight was completed, but its recording is no longer at {path}.",
                cause="the file was moved or deleted in flight. A moved file contains the whole "
                "recording; a deleted one is lost.",
                fix="heli3dof info FILE, with the moved file",
            )
        return Flight(read_recording(path), outcome, path)
    assert isinstance(sink, MemoryRecorder)
    about = {**meta, "outcome": outcome.ending, "outcome_details": outcome.details()}
    return Flight(sink.recording(profile, about), outcome, None)


def _fly(
    rig: StoppableRig,
    profile: Profile,
    signals: Signals,
    sink: RowSink,
    received: StopSignals,
    live: Live,
) -> Outcome:
    outcome = fly(
        rig,
        profile,
        signals,
        sink,
        stop=received.reason,
        stop_without_ramp=received.stop_without_ramp,
        live=live,
        monitors=monitors_for(profile),
    )
    # Disarm before the recording is finished: a disk may take longer than the device's watchdog.
    # `open_rig` closes the rig again, and reports what went wrong.
    with suppress(DeviceError):
        rig.close()
    if rig.session.stopped is None:
        return outcome
    # An emergency stop from another process ended the flight, in any of its phases.
    detail = Trip(
        f"{ON_REQUEST}: {rig.session.stop_reason}",
        "somebody ran heli3dof estop.",
        "find out who stopped it and why; then start again: arming clears the stop",
    )
    if not outcome.periods:
        detail = Trip(f"{detail}; it was not armed", detail.cause, detail.fix)
    return replace(outcome, ending="tripped", detail=detail, landed=False)


def _progress(live: Live) -> dict[str, Any]:
    return {
        "phase": live.phase,
        "done": live.done,
        "total": live.total,
        "late": live.late,
        "lateness_s": live.lateness,
    }
