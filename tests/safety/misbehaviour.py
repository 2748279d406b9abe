"""Random sequences of device misbehaviour during a flight, and the checks after each.

`emulated(seed)` flies the emulated device on a virtual clock, behind a line that damages bytes and
frames. Changed frames keep a valid checksum, as if the device itself stated nonsense.
`firmware(seed)` flies the C firmware in real time with its fault switches, stopped or killed at a
random moment.

After every sequence: only errors of the project, no outcome "error" ("an internal error"), and the
output at zero within the watchdog's time and the ramp after the host's last command.
"""

from __future__ import annotations

import os
import random
import signal
import tempfile
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
from heli3dof_drivers.emulator.endpoint import Endpoint
from heli3dof_drivers.emulator.transport_pty import emulated as emulated_endpoint
from heli3dof_drivers.link.frames import (
    Ack,
    Cause,
    Frame,
    IdentityFrame,
    Report,
    SampleFrame,
    parse,
    wire,
)
from heli3dof_drivers.link.rig import LinkRig

from heli3dof.cli.flight_summary import flight_document, flight_table
from heli3dof.errors import DeviceError, Heli3dofError
from heli3dof.experiment.control_loop.loop import Live
from heli3dof.experiment.fly import Flight, _fly_and_record, fly_plan, prepare
from heli3dof.experiment.plan import step_plan
from heli3dof.recording.info import summary
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.provenance import provenance
from heli3dof.rig.calibration import COUNTS_AT_POWER_UP
from heli3dof.rig.profile import default_profile
from heli3dof.rig.session.server import Session
from heli3dof.rig.session.stoppable_rig import StoppableRig
from tests.clock import Clock, installed
from tests.drivers.emulated_rigs import firmware_rig
from tests.drivers.link.lines import DirectLine

RAMP_S = 0.2
LONGEST_WATCHDOG_S = 1.0
"""s: the longest that the protocol allows"""
SLACK_S = 0.1
PLAN = step_plan((3.0, None, 5.0), settle_s=0.4, duration_s=0.4)
_base = default_profile()
PROFILE = _base.model_copy(
    update={"limits": _base.limits.model_copy(update={"landing_s": 0.3, "ramp_down_s": 0.1})}
).with_controller()
FLIGHT_S = 1.4
"""s from opening to the end of the ramp, about"""


@dataclass
class Result:
    """The result of one sequence."""

    seed: int
    faults: list[str]
    ending: str
    """The outcome, or ``refused`` if nothing flew"""
    wrong: list[str] = field(default_factory=list)
    """Failed checks"""


# ---- the emulated device, with faults in its line and its electronics ---------------------------

Change = Callable[["FaultyLine", random.Random, Frame, bytes], list[bytes]]


def _u(bits: int, rng: random.Random) -> int:
    """A random number of so many bits, often an extreme or a small one."""
    top = (1 << bits) - 1
    return rng.choice((0, 1, top, top >> 1, (top >> 1) + 1, rng.randrange(top + 1)))


def _i(bits: int, rng: random.Random) -> int:
    return _u(bits, rng) - (1 << (bits - 1))


def _states(kind: type, name: str, draw: Callable[[random.Random], Any]) -> Change:
    """A change that draws one field of one type of frame."""

    def change(line: FaultyLine, rng: random.Random, frame: Frame, piece: bytes) -> list[bytes]:
        if not isinstance(frame, kind):
            return [piece]
        return [wire(replace(frame, **{name: draw(rng)}))]  # type: ignore[type-var]

    return change


def _counts(how: Callable[[int, int, random.Random], int]) -> Change:
    """A change of one encoder's count."""

    def change(line: FaultyLine, rng: random.Random, frame: Frame, piece: bytes) -> list[bytes]:
        if not isinstance(frame, SampleFrame):
            return [piece]
        axis = line.axis
        was = line.held.setdefault(axis, getattr(frame, axis))
        count = how(getattr(frame, axis), was, rng)
        return [wire(replace(frame, **{axis: (count + 2**31) % 2**32 - 2**31}))]

    return change


def _time(how: Callable[[int, int, random.Random], int]) -> Change:
    def change(line: FaultyLine, rng: random.Random, frame: Frame, piece: bytes) -> list[bytes]:
        if not isinstance(frame, SampleFrame):
            return [piece]
        was = line.held.setdefault("time_us", frame.time_us)
        return [wire(replace(frame, time_us=how(frame.time_us, was, rng) % 2**32))]

    return change


def _bits(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data)
    for _ in range(rng.randint(1, 8)):
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def TEXT(rng: random.Random) -> bytes:
    """Sixteen bytes that are not ASCII text, or empty."""
    return rng.choice((b"", rng.randbytes(16), b"\0x", b"\x1b[2J")).ljust(16, b"\0")


U8, U16, U32 = (lambda rng, n=n: _u(n, rng) for n in (8, 16, 32))
I16, I32 = (lambda rng, n=n: _i(n, rng) for n in (16, 32))
LINE_FAULTS: dict[str, Change] = {
    "drops": lambda line, rng, frame, piece: [] if rng.random() < 0.3 else [piece],
    "is silent": lambda line, rng, frame, piece: [],
    "repeats": lambda line, rng, frame, piece: [piece, piece],
    "flips bits": lambda line, rng, frame, piece: (
        [_bits(piece, rng)] if rng.random() < 0.3 else [piece]
    ),
    "adds noise": lambda line, rng, frame, piece: [rng.randbytes(rng.randint(1, 200)), piece],
    "cuts frames": lambda line, rng, frame, piece: [piece[: rng.randrange(len(piece))]],
    "repeats old frames": lambda line, rng, frame, piece: [
        piece, rng.choice(line.sent or [piece]),
    ],
}  # fmt: skip
FALSE_FRAMES: dict[str, Change] = {
    **{f"sample.{n}": _states(SampleFrame, n, d) for n, d in {
        "number": U32, "echo": U32, "time_us": U32, "roll": I32, "pitch": I32, "yaw": I32,
        "front_uV": I32, "back_uV": I32, "front_mA": I16, "delay_us": U16, "flags": U8,
        "cause": U8,
    }.items()},
    **{f"ack.{n}": _states(Ack, n, d) for n, d in {
        "number": U32, "request": U8, "code": U8, "flags": U8, "cause": U8, "ticket": U32,
    }.items()},
    **{f"identity.{n}": _states(IdentityFrame, n, d) for n, d in {
        "number": U32, "version": U8, "flags": U8, "boot": U32, "ticket": U32,
        "counts_roll": I32, "counts_yaw": I32, "v_max_uV": U32, "watchdog_us": U32,
        "ramp_us": U32, "shortest_us": U32, "model": TEXT, "serial": TEXT, "firmware": TEXT,
    }.items()},
    **{f"report.{n}": _states(Report, n, d) for n, d in {
        "uptime_ms": U32, "cause": U8, "frames": U32, "ticket": U32,
    }.items()},
    "an encoder is frozen": _counts(lambda now, was, rng: was),
    "an encoder jumps": _counts(lambda now, was, rng: now + 500),
    "an encoder wraps at 16 bits": _counts(lambda now, was, rng: now + 65536),
    "an encoder wraps at 32 bits": _counts(lambda now, was, rng: now + 2**31 - 5),
    "an encoder counts backwards": _counts(lambda now, was, rng: 2 * was - now),
    "an encoder is noisy": _counts(lambda now, was, rng: now + rng.randint(-40, 40)),
    "the clock stops": _time(lambda now, was, rng: was),
    "the clock runs backwards": _time(lambda now, was, rng: 2 * was - now),
    "the clock jumps": _time(lambda now, was, rng: now + 2_000_000),
    "the clock runs at half speed": _time(lambda now, was, rng: (now + was) // 2),
}  # fmt: skip
EVENTS = (
    "the line is cut", "the device restarts", "the device restarts, its boot number repeated",
    "overcurrent", "button", "stall", "an unknown cause", "the device is held up",
    "the line delays", "the line echoes", "the line damages commands",
)  # fmt: skip


@dataclass
class Fault:
    """A fault, its time and its duration (s, since opening)."""

    kind: str
    at_s: float
    for_s: float

    def __str__(self) -> str:
        return f"{self.kind} at {self.at_s:.3f} s for {self.for_s:.3f} s"


def draw_faults(rng: random.Random) -> list[Fault]:
    """One to four faults between opening and the end of the ramp."""
    kinds = [*LINE_FAULTS, *FALSE_FRAMES, *EVENTS, *EVENTS]
    return [
        Fault(
            rng.choice(kinds),
            rng.choice((0.0, rng.uniform(0, FLIGHT_S))),
            rng.choice((0.003, 0.02, 0.2, 100.0)),
        )
        for _ in range(rng.randint(1, 4))
    ]


class FaultyLine(DirectLine):
    """The emulated device with its faults."""

    def __init__(self, rng: random.Random, faults: list[Fault], seed: int) -> None:
        self.rng, self.faults, self.seed = rng, faults, seed
        super().__init__(emulated_endpoint(f"mock:?seed={seed}"))
        self.axis = rng.choice(("roll", "pitch", "yaw"))
        self.held: dict[str, int] = {}
        self.sent: list[bytes] = []
        self.began = time.monotonic()
        self.done: set[int] = set()
        self.to_host, self.to_device = self._to_host, self._to_device
        self.largest_V = 0.0

    def active(self) -> Iterator[Fault]:
        t = time.monotonic() - self.began
        return (f for f in self.faults if f.at_s <= t < f.at_s + f.for_s)

    def write(self, data: bytes) -> None:
        self._act()
        super().write(data)
        if any(f.kind == "the line echoes" for f in self.active()):
            self._waiting += data

    def read(self, timeout_s: float) -> bytes:
        self._act()
        data = super().read(timeout_s)
        self._act()
        return data

    def _act(self) -> None:
        """Apply new faults once, and set the states of lasting ones."""
        kinds = set()
        for fault in self.active():
            kinds.add(fault.kind)
            if id(fault) not in self.done:
                self.done.add(id(fault))
                self._apply(fault)
        self.cut = "the line is cut" in kinds
        self.latency_s = 0.012 if "the line delays" in kinds else 0.0

    def _apply(self, fault: Fault) -> None:
        now = self.now_us
        stops = {
            "overcurrent": (Cause.OVERCURRENT, 2), "button": (Cause.BUTTON, 16),
            "stall": (Cause.STALL, 4), "an unknown cause": (200, 16),
        }  # fmt: skip
        if fault.kind in stops:
            cause, flag = stops[fault.kind]
            self.endpoint.stop(now, cause, flag)  # type: ignore[arg-type]
        elif fault.kind.startswith("the device restarts"):
            boot = self.endpoint._boot + (0 if "repeated" in fault.kind else 1)
            old = self.endpoint
            self.restart(Endpoint(old._device, serial=f"mock-{self.seed}", boot=boot & 0xFFFFFFFF))
        elif fault.kind == "the device is held up":
            time.sleep(min(fault.for_s, 0.5))
            self.endpoint.held_up(self.now_us)

    def _to_host(self, data: bytes) -> bytes:
        out = b""
        for stuffed in data.split(b"\0"):
            if not stuffed:
                continue
            pieces = [stuffed + b"\0"]
            for fault in self.active():
                change = LINE_FAULTS.get(fault.kind) or FALSE_FRAMES.get(fault.kind)
                if change is None:
                    continue
                changed: list[bytes] = []
                for piece in pieces:
                    frame = parse(piece[:-1]) if piece.endswith(b"\0") else None
                    if frame is None:
                        changed.append(piece)
                    else:
                        changed += change(self, self.rng, frame, piece)
                pieces = changed
            self.sent.append(stuffed + b"\0")
            del self.sent[:-50]
            out += b"".join(pieces)
        return out

    def _to_device(self, data: bytes) -> bytes:
        if any(f.kind == "the line damages commands" for f in self.active()):
            return _bits(data, self.rng) if self.rng.random() < 0.5 else b""
        return data


@contextmanager
def virtual_time() -> Iterator[Clock]:
    """A virtual clock for host and device, without real-time measures."""
    with pytest.MonkeyPatch.context() as patch:
        clock = installed(patch)
        patch.setattr("heli3dof.experiment.control_loop.rig_exchange.monotonic", clock.monotonic)
        # The boottime clock stays real: on a busy machine it would show a computer that slept.
        patch.setattr("heli3dof.experiment.safety_monitors.host_suspend.ahead_s", lambda: 0.0)
        patch.setattr("heli3dof.experiment.control_loop.loop.realtime", nullcontext)
        yield clock


def emulated(seed: int) -> Result:
    """One sequence on the emulated device: streamed for even seeds, polled for odd ones."""
    rng = random.Random(seed)
    faults = draw_faults(rng)
    result = Result(seed, [str(f) for f in faults], "refused")
    signals = prepare(PLAN, PROFILE, seed)
    with virtual_time() as clock:
        line = FaultyLine(rng, faults, seed)
        opened: LinkRig | None = None
        try:
            opened = LinkRig(line, PROFILE, driver="misbehaving", stream=seed % 2 == 0)
            with Session(f"misbehaving://{os.getpid()}", private=True) as session:
                rig = StoppableRig(opened, session, COUNTS_AT_POWER_UP)
                about = provenance(source="flight", plan=PLAN.to_dict(), identity=rig.identity)
                _judge(_fly_and_record(rig, PROFILE, signals, about, Live()), result)
        except Heli3dofError as problem:
            _explains(problem, result)
        except BaseException:
            result.wrong.append("crash: " + traceback.format_exc(limit=-6))
        finally:
            if opened is not None:
                with suppress(Heli3dofError):
                    opened.close()
        _ends_at_zero(line, clock, result)
    return result


def _judge(flight: Flight, found: Result) -> None:
    """Check the outcome, and everything that is shown of it."""
    outcome = flight.outcome
    found.ending = outcome.ending
    if outcome.ending == "error":
        error = outcome.error
        where = "" if error is None else "".join(traceback.format_exception(error, limit=-6))
        found.wrong.append(f"an internal error: {outcome.detail} {where}")
    flight_table(flight)
    flight_document(flight)
    summary(flight.recording)
    try:
        flight.raise_if_cut_short()
    except Heli3dofError as problem:
        _explains(problem, found)
    except KeyboardInterrupt:
        found.wrong.append("interrupted without a request")


def _explains(problem: Heli3dofError, found: Result) -> None:
    text = str(problem.what)
    if "internal error" in text or problem.exit_code == 1:
        found.wrong.append(f"an internal error: {text}")
    by_the_test = text.startswith(DirectLine.name)
    if isinstance(problem, DeviceError) and not ((problem.cause and problem.fix) or by_the_test):
        found.wrong.append(f"missing cause or fix: {text}")


def _ends_at_zero(line: FaultyLine, clock: Clock, found: Result) -> None:
    endpoint, began = line.endpoint, line.now_us
    watchdog_s = line.endpoint.amplifier._watchdog_us * 1e-6
    clock.sleep(watchdog_s + RAMP_S + 2e-3)
    endpoint.tick(line.now_us)
    volts = endpoint.amplifier.output_uV(max(line.now_us, began))
    if volts != (0, 0):
        found.wrong.append(f"motors not at zero: {volts} µV")
    if watchdog_s > LONGEST_WATCHDOG_S:
        found.wrong.append(f"a watchdog of {watchdog_s} s")


# ---- the C firmware, in real time ---------------------------------------------------------------


def draw_switches(rng: random.Random) -> tuple[list[str], float | None, str]:
    """Fault switches of the firmware, and when it is stopped or killed (None: never)."""

    def at() -> str:
        return f"{rng.uniform(0, FLIGHT_S):.3f}"

    axis = rng.choice(("roll", "pitch", "yaw"))
    choices = [
        ["--fault-after", rng.choice((at(), f"{at()}:0.05"))],
        ["--stall-after", rng.choice((at(), f"{at()}:0.05"))],
        ["--button-after", at()],
        ["--reset-after", at()],
        ["--reset-after", at(), "--boot", "7"],
        ["--freeze-encoder", f"{axis}@{at()}"],
        ["--jump-encoder", f"{axis}@{at()}:{rng.choice((-70000, -65536, -90, 300, 65536))}"],
        ["--drop", f"{rng.choice((0.0005, 0.005, 0.05)):g}"],
        ["--corrupt", f"{rng.choice((0.0005, 0.005, 0.05)):g}"],
        ["--delay", f"{rng.choice((1, 5, 25, 80)):d}"],
        ["--shortest", f"{rng.choice((500, 2000, 5000)):d}"],
        [],
    ]
    switches = [w for chosen in rng.sample(choices, rng.randint(1, 3)) for w in chosen]
    happens = rng.choice(("", "", "stop", "kill"))
    return switches, rng.uniform(0.05, FLIGHT_S) if happens else None, happens


def firmware(seed: int) -> Result:
    """One sequence on the firmware behind a pseudo-terminal, recorded to a file."""
    rng = random.Random(seed)
    switches, when_s, happens = draw_switches(rng)
    result = Result(seed, [" ".join(switches), f"{happens} at {when_s}"], "refused")
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", folder)
        log, path = Path(folder) / "log", Path(folder) / "flight.mcap"
        with firmware_rig("--log", str(log), "--seed", str(seed), *switches) as rig:
            if when_s is not None:
                timer = threading.Timer(when_s, _happen, (rig.process.pid, happens))
                timer.start()
            try:
                flight = fly_plan(PLAN, device=rig.url(f"stream={seed % 2}"), profile=PROFILE,
                                  output=path)  # fmt: skip
                _judge(flight, result)
                read_recording(path)
            except Heli3dofError as problem:
                _explains(problem, result)
            except BaseException:
                result.wrong.append("crash: " + traceback.format_exc(limit=-6))
            if when_s is not None:
                timer.cancel()
                timer.join()
            if happens == "kill" and rig.process.poll() is not None:
                return result  # without its program the rig has no output
            time.sleep(0.3 + RAMP_S + SLACK_S)
            last = log.read_text().splitlines()[-1:] if log.exists() else []
            if last and last[0].split()[1:] != ["0", "0.000000", "0.000000"]:
                time.sleep(1.0)  # a busy machine may hold the program up
                last = log.read_text().splitlines()[-1:]
                if last[0].split()[1:] != ["0", "0.000000", "0.000000"]:
                    result.wrong.append(f"motors not at zero: {last[0]}")
    return result


def _happen(pid: int, what: str) -> None:
    with suppress(ProcessLookupError):
        if what == "kill":
            os.kill(pid, signal.SIGKILL)
        else:
            os.kill(pid, signal.SIGSTOP)
            time.sleep(0.25)
            os.kill(pid, signal.SIGCONT)


def endings(results: list[Result]) -> str:
    """Number of flights per outcome, most frequent first."""
    counted = Counter(r.ending for r in results).most_common()
    return ", ".join(f"{n} {ending}" for ending, n in counted)
