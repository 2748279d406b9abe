"""Every row of safety.md at random moments of a flight, on the emulated rig and the firmware.

    moment i of n  =  (i + u) T/n,   u drawn from [0, 1)

T is the whole flight from its first control period to zero volts at the end of the ramp, so every
part of the flight has a moment. If another process causes the event, T begins with the device's
first byte.

Rows that need neither a process nor a line fly the emulated rig in this process on its virtual
clock, with the limits of the default profile. All others fly in real time in a process of their
own, with the device behind a pseudo-terminal.
"""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import pairwise
from math import degrees, inf
from pathlib import Path
from typing import Any

import pytest

from heli3dof.errors import RecordingError
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.rig.profile import Profile, default_profile
from heli3dof.rig.profile import load_profile as profile_of
from heli3dof.rig.session.estop import request_estop
from heli3dof.rig.session.stop_stamp import start_command
from tests.cli.running import heli3dof
from tests.profiles import END_S, PATIENT, STALL_S, START_S, write_profile
from tests.safety.aboard import Aboard
from tests.safety.bench import Bench
from tests.safety.relay import FirmwareBench, zero_since
from tests.safety.sabotage import sabotage, stamp_reports
from tests.safety.table import BY_NAME, INSTANT, NO_EFFECT, WATCHDOG

SEED = 1412
EMULATED, FIRMWARE = "emulated rig", "firmware in C"
CALM = "nothing"
"""Not a row: the same flight without a fault, for comparison"""
SIGNALS = {
    "ctrl_c": [signal.SIGINT],
    "second_ctrl_c": [signal.SIGINT, signal.SIGINT],
    "sigterm": [signal.SIGTERM],
    "terminal_closed": [signal.SIGHUP],
}
BETWEEN_S = 0.1
"""s between two Ctrl-C"""
SABOTAGE = {
    "exception_in_the_controller": "exception",
    "nan_from_the_controller": "nan",
    "envelope_trip": "envelope",
    "saturated_for_too_long": "limit",
    "late_ticks": "late",
    "full_disk": "disk",
    "laptop_suspend": "sleep",
    "amplifier_output": "amplifier",
}
CLOSED_LOOP_ONLY = {"exception", "nan", "envelope", "limit"}
"""Sabotage without effect in the ramp, which uses neither controller nor envelope"""
AXES = ("roll", "pitch", "yaw")
MOCK_FAULTS = {
    "encoder_jump": "jump.{axis}@{s:g}:-200",
    "frozen_encoder": "frozen.{axis}@{s:g}",
    "stalled_motor": "stall@{s:g}",
    "amplifier_fault": "overcurrent@{s:g}",
    "button": "button@{s:g}",
}
SWITCHES = {
    "encoder_jump": ("--jump-encoder", "{axis}@{s:g}:-200"),
    "frozen_encoder": ("--freeze-encoder", "{axis}@{s:g}"),
    "stalled_motor": ("--stall-after", "{s:g}:0.2"),
    "amplifier_fault": ("--fault-after", "{s:g}:0.2"),
    "button": ("--button-after", "{s:g}"),
    "device_reset": ("--reset-after", "{s:g}"),
}
NEED_A_PROCESS = {
    "estop_from_a_second_terminal", "kill_9", "stopped_process", "cable_out", "device_reset",
    "lost_frames", "late_ticks", "second_process",
}  # fmt: skip
"""Rows that the emulated rig shows behind a pseudo-terminal, in real time"""
NOTICED = {
    "frozen_encoder", "late_ticks", "lost_frames", "saturated_for_too_long", "full_disk",
    "amplifier_output",
}  # fmt: skip
"""Rows whose time counts from detection by the loop. The loop detects an angle beyond the envelope
in the sample that shows it, so that time counts from the event"""
RULE_S = {"saturated_for_too_long": 0.3, "late_ticks": 0.7, "lost_frames": 0.3}
"""s that the monitor needs: a fault that begins later is reported after the plan"""
SETTLE_S, STEP_S = 2.0, 2.0
RAMP_S = {EMULATED: 3.0, FIRMWARE: 1.5}
"""s of the ramp at the plan's end; shorter in real time, for hundreds of flights"""
FLIGHT = (
    "run-step", "--roll", "10", "--yaw", "20", "--settle", str(SETTLE_S),
    "--duration", str(STEP_S), "--quiet",
)  # fmt: skip
RATE_HZ = 200
AFTERWARDS_S = 1.2
"""s at zero volts after which the arm is on its table from any height"""
STOPPED_S = 1.0
"""s for which a process is stopped: longer than watchdog and ramp"""
LOST_S = 0.45
"""s for which the line carries nothing one way"""
TABLE_DEG = -27.5
ABOVE_DEG = 0.3
"""° above the table within which the arm has arrived on it"""


@dataclass(frozen=True)
class Case:
    """One flight: the fault in it, and its time."""

    row: str
    device: str
    number: int
    moment_s: float

    @property
    def virtual(self) -> bool:
        return self.device == EMULATED and self.row not in NEED_A_PROCESS

    @property
    def axis(self) -> str:
        return AXES[self.number % 3]

    def __str__(self) -> str:
        return f"{self.row} on the {self.device}, {self.moment_s:.3f} s"


@dataclass
class Run:
    """The outcome of a case."""

    case: Case
    phase: str = ""
    """Phase of the flight at the event"""
    event_s: float | None = None
    """On the flight's clock; None: it did not happen"""
    since_s: float | None = None
    """From when the row's time counts"""
    zero_s: float | None = None
    """Time from which the output is zero; None: it was always zero"""
    bound_s: float = 0.0
    """The row's bound"""
    late_s: float = 0.0
    """Largest lateness of the flight's loop, from its recording"""
    roll_max_deg: float = -inf
    """Largest roll from the event on"""
    table_deg_per_s: float | None = None
    """Speed at which the arm reached the table after the event; None: it was there already"""
    code: int | None = None
    """Exit code"""
    ending: str = ""
    detail: str = ""
    second_code: int | None = None
    """Exit code of the second process that opens the rig"""
    again: int = 0
    """Repetitions because of host stalls"""
    wrong: list[str] = field(default_factory=list)

    @property
    def took_s(self) -> float | None:
        """s from ``since_s`` to zero volts; 0 if the volts were zero; None without an event."""
        if self.since_s is None:
            return None
        return max(0.0, self.zero_s - self.since_s) if self.zero_s is not None else 0.0

    @property
    def in_flight(self) -> bool:
        """Whether the event was between arming and zero volts at the end."""
        return self.phase not in ("opening", "over", "")

    @property
    def at_rest(self) -> bool:
        """Whether an encoder froze without any motion to come: pitch or yaw in the ramp, or any
        axis after the arm was down. No monitor can detect that (docs/reference/safety.md)."""
        down = self.roll_max_deg < TABLE_DEG + ABOVE_DEG
        still = self.case.axis != "roll" or down
        return self.case.row == "frozen_encoder" and self.phase == "ramp" and still

    @property
    def as_claimed(self) -> bool:
        """Whether exit code, outcome and message are the row's."""
        row = BY_NAME[self.case.row]
        if row.exit_code < 0:
            return self.code == row.exit_code and self.ending == "recovered"
        part = row.detail if not row.detail.startswith("gone") else "gone"
        return (self.code, self.ending) == (row.exit_code, row.ending) and part in self.detail


def cases(n: int) -> list[Case]:
    """All flights; first those in real time, which take long."""
    made = []
    for device in (FIRMWARE, EMULATED):
        for row in (CALM, *BY_NAME):
            draw = random.Random(f"{SEED} {row} {device}")
            many = 1 if row == CALM else n
            for i in range(many):
                u = (i + draw.random()) / many
                case = Case(row, device, i, 0.0)
                made.append(Case(row, device, i, round(u * span_s(case), 3)))
    return sorted(made, key=lambda case: case.virtual)


def span_s(case: Case) -> float:
    """s over which this row's moments are drawn."""
    in_closed_loop = SETTLE_S + STEP_S - RULE_S.get(case.row, 0.0)
    if SABOTAGE.get(case.row) in CLOSED_LOOP_ONLY:
        return in_closed_loop
    ramp_s = RAMP_S[EMULATED if case.virtual else FIRMWARE]
    return in_closed_loop + ramp_s


def fly(case: Case) -> Run:
    """Fly one case. Failures of the bench itself go into ``wrong``."""
    run = Run(case)
    _take_signals()
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as folder:
        patch.setenv("XDG_STATE_HOME", folder)
        start_command()
        try:
            (_in_process if case.virtual else _on_a_line)(case, run, patch, Path(folder))
        except Exception as problem:
            run.wrong.append(f"{type(problem).__name__}: {problem}")
    return run


def _take_signals() -> None:
    """Stop ignoring signals, as a background job or nohup does: flights would inherit it, and
    ignore Ctrl-C."""
    for number, handler in (
        (signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL),
    ):  # fmt: skip
        if signal.getsignal(number) == signal.SIG_IGN:
            signal.signal(number, handler)


HELD_UP = {"stopped_process", "laptop_suspend", "late_ticks", "lost_frames"}
"""Rows in which the loop is late because of the event"""
ATTEMPTS = 3


def fly_again_where_held_up(case: Case) -> Run:
    """`fly`, repeated if the machine, not the event, held the loop up or ended the flight."""
    for attempt in range(ATTEMPTS):
        run = fly(case)
        run.again = attempt
        held_up = run.late_s > STALL_S and case.row not in HELD_UP
        ended_before = run.event_s is None and not run.wrong
        if case.virtual or not (held_up or ended_before):
            break
    return run


# ---- in this process, on the virtual clock ------------------------------------------------------


def _in_process(case: Case, run: Run, patch: pytest.MonkeyPatch, folder: Path) -> None:
    aboard = Aboard(patch, folder)
    profile = default_profile()
    at_s = round(case.moment_s / profile.dt) * profile.dt
    url, words = "mock:?seed=1&speed=" + ("5" if case.row == "full_disk" else "max"), []
    stamps: dict[str, float] = {}

    def stamp(what: str) -> None:
        stamps.setdefault(what, aboard.t)

    if case.row in SIGNALS:
        _send_signals(aboard, SIGNALS[case.row], at_s if case.number else None, stamp)
    elif case.row in SABOTAGE:
        if case.row == "saturated_for_too_long":
            weak = write_profile(folder / "rig.toml", **WEAK)
            words = ["--profile", str(weak)]
            profile = profile_of(weak)
        sabotage(SABOTAGE[case.row], lambda: aboard.t >= at_s - 1e-9, stamp, patch.setattr)
    elif case.row in MOCK_FAULTS:
        url += "&fault=" + MOCK_FAULTS[case.row].format(axis=case.axis, s=at_s)
        stamps["event"] = max(at_s, profile.dt)
    if case.row in NOTICED:
        stamp_reports(stamp, patch.setattr)
    path = folder / "flight.mcap"
    result = heli3dof(*FLIGHT, "--device", url, "-o", path, *words)
    run.code = result.code
    device = aboard.device
    armed = bool(aboard.volts)
    device.disable()
    for _ in range(round(AFTERWARDS_S / device.plant.dt)):
        device.period()
    _read(run, path, result.err)
    run.zero_s = max((t + device.plant.dt for t, *v in aboard.volts if any(v)), default=None)
    run.event_s = stamps.get("event")
    if case.row == CALM:
        run.event_s = 0.0
    over_s = run.zero_s or 0.0
    settled = SETTLE_S + STEP_S
    run.phase = "opening" if not armed else _phase(run.event_s, 0.0, settled, over_s)
    if case.row in SIGNALS and case.number == 0:
        run.phase = "arming"
    _since(run, profile, device.watchdog_s, stamps.get("noticed"), None)
    _motion(run, aboard.motion)


WEAK = {"saturated_max_s": 0.2, "slew_max_V_per_s": 1e6}
"""Limits of the row about saturation: within two seconds the envelope would trip first"""


def _send_signals(
    aboard: Aboard, numbers: list[signal.Signals], at_s: float | None, stamp: Callable[[str], None]
) -> None:
    """Send signals at that time, or at arming (None); the event is the last of them."""

    def send(number: signal.Signals) -> None:
        if number == signal.SIGHUP and signal.getsignal(number) in (signal.SIG_DFL, signal.SIG_IGN):
            return  # the flight is over, and this process must not end
        signal.raise_signal(number)

    for i, number in enumerate(numbers):
        last = i == len(numbers) - 1

        def act(number: signal.Signals = number, last: bool = last) -> None:
            if last:
                stamp("event")
            send(number)

        if at_s is None:
            aboard.when_arming.append(act)
        else:
            aboard.at(at_s + i * BETWEEN_S, act)


# ---- in real time, behind a pseudo-terminal -----------------------------------------------------


def _on_a_line(case: Case, run: Run, patch: pytest.MonkeyPatch, folder: Path) -> None:
    limits: dict[str, Any] = {**PATIENT, "landing_s": RAMP_S[FIRMWARE], "rate_hz": RATE_HZ}
    watchdog_s = 0.3 if case.row != CALM and BY_NAME[case.row].zero is WATCHDOG else 0.9
    serial = random.SystemRandom().randrange(1, 10**9)
    if case.row == "lost_frames":
        limits["lost_max_s"] = 0.2
    if case.row == "encoder_jump":
        usual = default_profile().to_dict()["limits"]
        limits |= {key: usual[key] for key in limits if "_rate_max_" in key}
    if case.row == "late_ticks":
        limits |= {"late_max_s": 0.03, "late_max_share": 0.5}
    if case.row == "saturated_for_too_long":
        limits |= WEAK
    toml = write_profile(folder / "rig.toml", **limits)
    path, stamps = folder / "flight.mcap", folder / "stamps"
    with ExitStack() as stack:
        rig: Bench | FirmwareBench
        if case.device == FIRMWARE:
            given = SWITCHES.get(case.row, ())
            switches = [word.format(axis=case.axis, s=case.moment_s) for word in given]
            switches += ["--serial", f"S{serial}"]
            rig = stack.enter_context(FirmwareBench(folder, watchdog_s, *switches))
        else:
            rig = stack.enter_context(Bench(watchdog_s, start="rest", seed=serial))
        kind = SABOTAGE.get(case.row)
        module = ["heli3dof"]
        if kind is not None or case.row in NOTICED:
            what = f"{kind or 'none'}@{case.moment_s:g}"
            module = ["tests.safety.sabotage", what, str(stamps)]
        command = [
            sys.executable, "-m", *module, *FLIGHT, "--device", rig.url, "-o", str(path),
            "--profile", str(toml),
        ]  # fmt: skip
        process = stack.enter_context(
            subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        )
        stack.callback(process.kill)
        _until(lambda: rig.opened_s is not None or process.poll() is not None, START_S)
        event_s = None
        if case.row not in SWITCHES or (case.device == EMULATED and case.row == "device_reset"):
            event_s = _happen(case, rig, process, folder, run)
        if kind == "sleep":
            _wake(process)
        _, err = process.communicate(timeout=END_S)
        run.code = process.returncode
        _until(lambda: _zero(rig) not in (inf,), 5.0)
        zero = _zero(rig)
        time.sleep(AFTERWARDS_S)
        outputs, motion = _outputs(rig), list(rig.motion)
        armed_s = _armed(rig)
        commands = rig.carried_s if isinstance(rig, FirmwareBench) else [rig.last_command_s]
    if run.code == -signal.SIGKILL:
        run.ending = "nothing recorded"
        if path.exists() and heli3dof("recover", path, "--quiet").code == 0:
            path = path.with_name("flight.recovered.mcap")
    _read(run, path, err)
    if case.row == "second_process":
        # The table's exit code is that of the second process; the first must end with 0.
        if run.code != 0:
            run.wrong.append(f"the flight ended with {run.code}: {err[-200:]}")
        run.code = run.second_code
    run.zero_s = zero
    stamped = _stamps(stamps)
    run.event_s = stamped.get("event", event_s)
    if case.row in SWITCHES and event_s is None and armed_s is not None:
        run.event_s = armed_s + case.moment_s
    if case.row == CALM:
        run.event_s = armed_s
    over_s = next((t for t, *v in reversed(outputs) if any(v)), -inf)
    begun = armed_s if armed_s is not None else inf
    run.phase = _phase(run.event_s, begun, begun + SETTLE_S + STEP_S, max(over_s, zero or -inf))
    last = max((t for t in commands if zero is None or t <= zero), default=None)
    _since(run, profile_of(toml), watchdog_s, stamped.get("noticed"), last)
    _motion(run, motion)


def _happen(
    case: Case, rig: Bench | FirmwareBench, process: subprocess.Popen[str], folder: Path, run: Run
) -> float | None:
    """Cause the event from another process or on the line; the time of that."""
    if case.row == CALM or case.row in SABOTAGE:
        return None
    if case.row == "estop_from_a_second_terminal":
        request_estop("serial:///dev/heli3dof-absent", "loads the code before the measurement")
    assert rig.opened_s is not None, "the flight never opened its device"
    time.sleep(max(0.0, rig.opened_s + case.moment_s - time.monotonic()))
    if process.poll() is not None:
        return None
    now = time.monotonic()
    if case.row in SIGNALS:
        for i, number in enumerate(SIGNALS[case.row]):
            time.sleep(BETWEEN_S if i else 0.0)
            now = time.monotonic()
            process.send_signal(number)
    elif case.row == "kill_9":
        process.kill()
    elif case.row == "stopped_process":
        process.send_signal(signal.SIGSTOP)
        time.sleep(STOPPED_S)
        process.send_signal(signal.SIGCONT)
    elif case.row == "estop_from_a_second_terminal":
        result = request_estop(rig.url, "a bench")
        (stopped,) = result.stopped + result.unconfirmed
        if not stopped.done:
            run.wrong.append(f"not stopped: {stopped.how}")
    elif case.row == "cable_out":
        now = rig.pull()
    elif case.row == "device_reset":
        assert isinstance(rig, Bench)
        now = rig.reset()
    elif case.row == "lost_frames":
        which = "deaf" if case.number % 2 else "mute"
        setattr(rig, which, True)
        time.sleep(LOST_S)
        setattr(rig, which, False)
    elif case.row == "second_process":
        other = heli3dof(*FLIGHT, "--device", rig.url, "-o", folder / "second.mcap")
        run.second_code = other.code
    return now


def _wake(process: subprocess.Popen[str]) -> None:
    """Continue a process that stopped itself, after a while."""
    stat = Path(f"/proc/{process.pid}/stat")
    while process.poll() is None:
        if stat.read_text().rpartition(")")[2].split()[0] == "T":
            time.sleep(STOPPED_S)
            process.send_signal(signal.SIGCONT)
            return
        time.sleep(0.02)


def _outputs(rig: Bench | FirmwareBench) -> list[tuple[float, float, float]]:
    if isinstance(rig, FirmwareBench):
        return rig.outputs
    return [(o.t, float(o.front_uV), float(o.back_uV)) for o in list(rig.log)]


def _armed(rig: Bench | FirmwareBench) -> float | None:
    if isinstance(rig, FirmwareBench):
        return rig.armed_s
    return next((o.t for o in rig.log if o.flags & 1), None)


def _zero(rig: Bench | FirmwareBench) -> float | None:
    return zero_since(_outputs(rig))


def _stamps(path: Path) -> dict[str, float]:
    """The first time of each stamp."""
    result: dict[str, float] = {}
    if path.exists():
        for line in path.read_text().splitlines():
            what, t = line.split()
            result.setdefault(what, float(t))
    return result


def _until(reached: Callable[[], bool], most_s: float) -> None:
    deadline = time.monotonic() + most_s
    while not reached() and time.monotonic() < deadline:
        time.sleep(5e-3)


# ---- results --------------------------------------------------------------------------------


def _read(run: Run, path: Path, err: str) -> None:
    """Outcome and message from the recording; without one, from standard error."""
    if not path.exists():
        run.detail = err[-300:]
        return
    try:
        meta = read_recording(path).meta
    except RecordingError as problem:  # a flight without a sample: the error holds the outcome
        ending, _, run.detail = problem.what.partition("contains no samples: ")[2].partition(", ")
        run.ending = ending or problem.what
        return
    run.ending = str(meta.get("outcome"))
    details = meta.get("outcome_details") or {}
    run.detail = str(details.get("detail", ""))
    run.late_s = float(details.get("worst_lateness_s") or 0.0)


def _phase(at_s: float | None, armed_s: float, settled_s: float, over_s: float) -> str:
    if at_s is None:
        return ""
    if at_s < armed_s:
        return "opening"
    if at_s > over_s + 1e-6:
        return "over"
    return "ramp" if at_s > settled_s else "take-off" if at_s < armed_s + SETTLE_S else "step"


def _since(
    run: Run,
    profile: Profile,
    watchdog_s: float,
    noticed: float | None,
    last_command: float | None,
) -> None:
    """The row's bound, and from when it counts."""
    if run.case.row == CALM:
        return
    bound = BY_NAME[run.case.row].zero
    run.bound_s = bound.seconds(profile, watchdog_s)
    run.since_s = run.event_s
    if bound is NO_EFFECT:
        run.since_s = None
    if run.event_s is None:
        return
    if bound is WATCHDOG and last_command is not None and not run.case.virtual:
        run.since_s = last_command
    if run.case.row in NOTICED:
        run.since_s = noticed


def _motion(run: Run, motion: list[tuple[float, float, float]]) -> None:
    """Largest roll after the event, and the speed at the table."""
    if run.event_s is None:
        return
    after = [(degrees(roll), degrees(rate)) for t, roll, rate in motion if t >= run.event_s]
    if not after:
        return
    run.roll_max_deg = max(roll for roll, _ in after)
    for (before, rate), (roll, _) in pairwise(after):
        if before > TABLE_DEG + ABOVE_DEG >= roll:
            run.table_deg_per_s = max(run.table_deg_per_s or 0.0, -rate)


def is_instant(case: Case) -> bool:
    """Whether the device stops on its own in the same instant."""
    return case.row != CALM and BY_NAME[case.row].zero is INSTANT
