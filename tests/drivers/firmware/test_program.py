"""The firmware as a program: Python's frames over its PTY, and its true motor voltages."""

from __future__ import annotations

import random
import statistics
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path

import pytest
import serial
from heli3dof_drivers.link.frames import (
    Ack,
    Arm,
    Cause,
    Code,
    CommandFrame,
    Disarm,
    Estop,
    Frame,
    Hello,
    IdentityFrame,
    Poll,
    Report,
    SampleFrame,
    Splitter,
    Status,
    wire,
)

from tests.drivers.emulated_rigs import RigProcess, firmware_rig
from tests.drivers.firmware.building import rig_program
from tests.profiles import STALL_S

PATIENCE_S = 30.0
WATCHDOG_S, RAMP_S = 0.3, 0.2
BUSY_S = 2 * (STALL_S + 0.05)
"""s by which a busy machine may delay the firmware's process in all; half of it at once"""
ROUNDS = 20
"""Attempts on a busy machine; a faulty device fails in each"""
VOLTS = 9_000_000


class Host:
    """A host that sends any bytes and keeps the received frames."""

    def __init__(self, path: str) -> None:
        self.port = serial.Serial(path, 921600, timeout=0.05)
        self.splitter = Splitter()
        self.heard: list[Frame] = []
        self.number = 0
        self.port.write(b"\0")

    def say(self, frame: Frame) -> None:
        self.port.write(wire(frame))

    def hear(
        self, kind: type[Frame], number: int | None = None, within_s: float = PATIENCE_S
    ) -> Frame:
        """The next frame of this kind; earlier ones are kept in ``heard``."""
        end = time.monotonic() + within_s
        while time.monotonic() < end:
            while self.heard:
                frame = self.heard.pop(0)
                if isinstance(frame, kind) and number in (None, frame.number):
                    return frame
            self.heard += self.splitter.feed(self.port.read(max(1, self.port.in_waiting)))
        raise AssertionError(f"no {kind.__name__} within {within_s} s")

    def ask(self, frame: Frame, kind: type[Frame]) -> Frame:
        self.say(frame)
        return self.hear(kind, None if kind is SampleFrame else frame.number)

    def identity(self) -> IdentityFrame:
        answer = self.ask(Hello(7), IdentityFrame)
        assert isinstance(answer, IdentityFrame)
        return answer

    def found_again(self) -> IdentityFrame:
        """Request the identity until the device replies: a board that is starting does not."""
        for number in range(100, 100 + 10 * round(PATIENCE_S)):
            self.port.reset_input_buffer()
            self.say(Hello(number))
            with suppress(AssertionError):
                answer = self.hear(IdentityFrame, number, within_s=0.1)
                assert isinstance(answer, IdentityFrame)
                return answer
        raise AssertionError(f"no answer to a HELLO within {PATIENCE_S} s")

    def poll(self) -> SampleFrame:
        answer = self.ask(Poll(8), SampleFrame)
        assert isinstance(answer, SampleFrame)
        return answer

    def arm(self, period_us: int = 0) -> Ack:
        self.number = 0
        answer = self.ask(Arm(0, self.identity().ticket, period_us, 0), Ack)
        assert isinstance(answer, Ack)
        if answer.code == Code.OK:
            assert self.hear(SampleFrame).number == 0
        return answer

    def command(self, front_uV: int = VOLTS, back_uV: int = VOLTS) -> None:
        self.number += 1
        self.say(CommandFrame(self.number, front_uV, back_uV))

    def fly(self, seconds: float) -> list[SampleFrame]:
        """Send commands every 10 ms and read; ends when the device has stopped."""
        samples = []
        end = time.monotonic() + seconds
        while time.monotonic() < end and (not samples or samples[-1].flags & 1):
            self.command()
            samples.append(self.poll())
            time.sleep(0.01)
        return samples


PATIENT = ("--watchdog", "1000")
"""For tests in which the host must not be late: the machine may be busy."""


@contextmanager
def rig(*options: str) -> Iterator[tuple[RigProcess, Host]]:
    with firmware_rig(*options) as emulated:
        host = Host(emulated.path)
        try:
            yield emulated, host
        finally:
            host.port.close()


def motors(log: Path) -> list[tuple[float, bool, float, float]]:
    """(CLOCK_MONOTONIC in s, enabled, V, V) at each change."""
    rows = [line.split() for line in log.read_text().splitlines()]
    return [(float(t), on == "1", float(front), float(back)) for t, on, front, back in rows]


def test_hello_arm_command_sample_disarm():
    with rig("--serial", "S-17") as (_, host):
        identity = host.identity()
        assert identity.serial.rstrip(b"\0") == b"S-17"
        assert identity.model.startswith(b"emulated")
        assert host.arm().code == Code.OK
        host.command(5_000_000, -6_000_001)
        sample = host.poll()
        assert (sample.front_uV, sample.back_uV, sample.echo) == (5_000_000, -6_000_001, 1)
        assert sample.delay_us < 0xFFFF
        host.say(Disarm(9))
        assert host.hear(Ack, 9).code == Code.OK  # type: ignore[union-attr]
        assert host.poll().front_uV == 0


def test_the_stream_follows_the_devices_clock_in_order():
    for _ in range(ROUNDS):
        with rig() as (_, host):
            host.arm(period_us=2000)
            samples = [host.hear(SampleFrame) for _ in range(50)]
            report = host.ask(Status(12), Report)
        assert [s.number for s in samples] == sorted({s.number for s in samples})
        periods = [
            (b.time_us - a.time_us) / (b.number - a.number)  # type: ignore[union-attr]
            for a, b in pairwise(samples)
        ]
        usual = statistics.median(periods)
        if usual == pytest.approx(2000, abs=200):
            return
        # A gap is allowed only where the device reports that it was held up.
        assert report.late_us > 1000, usual  # type: ignore[union-attr]
    pytest.skip(f"a machine so busy that in none of {ROUNDS} streams the device was in time")


def test_without_commands_the_motors_reach_zero_within_watchdog_and_ramp(tmp_path: Path):
    with rig("--log", str(tmp_path / "log")) as (_, host):
        host.arm()
        host.fly(0.2)
        before = time.monotonic()
        host.command()
        last = time.monotonic()
        time.sleep(WATCHDOG_S + RAMP_S + BUSY_S + 0.1)
        rows = motors(tmp_path / "log")
        at, enabled, front, back = rows[-1]
        assert (enabled, front, back) == (False, 0.0, 0.0)
        assert before + WATCHDOG_S + RAMP_S - 0.05 < at < last + WATCHDOG_S + RAMP_S + BUSY_S
        ramp = [front for t, _, front, _ in rows if t > last + WATCHDOG_S]
        assert len(ramp) > 5
        assert ramp == sorted(ramp, reverse=True)
        assert host.poll().cause == Cause.WATCHDOG


def test_a_host_that_does_not_read_stops_neither_the_clock_nor_the_watchdog(tmp_path: Path):
    with rig("--log", str(tmp_path / "log")) as (_, host):
        host.arm(period_us=500)
        host.command()
        time.sleep(
            WATCHDOG_S + RAMP_S + BUSY_S
        )  # 2000 samples of 48 bytes: more than a PTY buffers
        assert motors(tmp_path / "log")[-1][1:] == (False, 0.0, 0.0)
        report = host.ask(Status(11), Report)
        assert isinstance(report, Report)
        assert report.expiries == 1
        assert host.splitter.malformed == 0  # frames were dropped whole


def test_the_host_may_close_the_port_and_open_it_again():
    with rig() as (emulated, host):
        boot = host.identity().boot
        for _ in range(3):
            host.port.close()
            host = Host(emulated.path)
            assert host.identity().boot == boot


def test_an_estop_stops_at_once_after_any_bytes(tmp_path: Path):
    with rig("--log", str(tmp_path / "log")) as (_, host):
        host.arm()
        host.fly(0.1)
        host.port.write(wire(Hello(1))[:9])
        sent = time.monotonic()
        answer = host.ask(Estop(0xFFFFFFFF, Cause.HOST_ESTOP), Ack)
        assert (answer.code, answer.cause) == (Code.OK, Cause.HOST_ESTOP)  # type: ignore[union-attr]
        at, *out = motors(tmp_path / "log")[-1]
        assert out == [False, 0.0, 0.0]
        assert at - sent < BUSY_S / 2


def test_watchdog_and_estop_work_during_a_flood_of_noise(tmp_path: Path):
    with rig("--log", str(tmp_path / "log")) as (_, host):
        noise = random.Random(3).randbytes(4096)
        host.arm()
        host.command()
        end = time.monotonic() + WATCHDOG_S + RAMP_S + 0.5
        while time.monotonic() < end:
            host.port.write(noise)
        assert motors(tmp_path / "log")[-1][1:] == (False, 0.0, 0.0)
        answer = host.ask(Estop(3, Cause.BUTTON), Ack)
        assert answer.cause == Cause.BUTTON  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("drill", "cause", "flag"),
    [
        ("--fault-after", Cause.OVERCURRENT, 2),
        ("--stall-after", Cause.STALL, 4),
        ("--button-after", Cause.BUTTON, 16),
    ],
)
def test_a_drill_stops_the_rig_and_reports_its_cause(
    drill: str, cause: Cause, flag: int, tmp_path: Path
):
    with rig(*PATIENT, drill, "0.2", "--log", str(tmp_path / "log")) as (_, host):
        host.arm()
        last = host.fly(3.0)[-1]
        assert (last.cause, last.flags, last.front_uV) == (cause, flag, 0)
        assert motors(tmp_path / "log")[-1][1:] == (False, 0.0, 0.0)


def test_a_device_with_a_fault_cannot_be_armed():
    with rig(*PATIENT, "--fault-after", "0.1:1.5") as (_, host):
        host.arm()
        host.fly(3.0)
        assert host.arm().code == Code.FAULT
        time.sleep(1.8)
        assert host.arm().code == Code.OK


def test_a_reset_clears_the_state_and_changes_the_boot_number():
    with rig(*PATIENT, "--reset-after", "0.3") as (_, host):
        before = host.identity()
        host.arm()
        last = host.fly(3.0)[-1]
        after = host.identity()
        assert after.boot != before.boot
        assert (last.flags, last.front_uV, last.echo) == (0, 0, 0)
        assert abs(last.roll) < abs(before.counts_roll) / 8


def test_a_frozen_encoder_keeps_its_count_while_the_arm_moves():
    with rig(*PATIENT, "--freeze-encoder", "roll@0.4") as (_, host):
        host.arm()
        rolls = [s.roll for s in host.fly(1.2)]
        assert len(set(rolls[-5:])) == 1  # 50 ms at 0.5 rad/s would be 16 counts
        assert rolls[-1] > 0


def test_a_jump_occurs_between_two_samples():
    with rig(*PATIENT, "--jump-encoder", "yaw@0.3:-500") as (_, host):
        host.arm()
        yaws = [s.yaw for s in host.fly(0.8)]
        steps = [b - a for a, b in pairwise(yaws)]
        assert min(steps) == pytest.approx(-500, abs=3)
        assert sum(abs(s) > 100 for s in steps) == 1


def test_on_a_lossy_line_accepted_frames_are_correct():
    with rig("--drop", "0.002", "--corrupt", "0.002", "--seed", "5") as (_, host):
        answers, sent, end = 0, -1, time.monotonic() + PATIENCE_S
        while (sent < 399 or answers <= 200) and time.monotonic() < end:
            if sent < 399:
                sent += 1
                host.say(Status(sent))
            time.sleep(0.001)
            for frame in host.splitter.feed(host.port.read(host.port.in_waiting)):
                assert isinstance(frame, Report)
                assert frame.number <= sent
                assert frame.uptime_ms < 60_000
                answers += 1
        assert answers > 200
        assert host.splitter.malformed > 0


def test_a_terminated_program_leaves_zero_volts_and_no_link(tmp_path: Path):
    link, log = tmp_path / "rig", tmp_path / "log"
    with rig("--link", str(link), "--log", str(log)) as (emulated, host):
        assert link.resolve() == Path(emulated.path)
        host.arm()
        host.fly(0.1)
        emulated.process.terminate()
        assert emulated.process.wait(PATIENCE_S) == 0
        assert motors(log)[-1][1:] == (False, 0.0, 0.0)
        assert not link.is_symlink()


def test_it_ends_with_its_parent(tmp_path: Path):
    link = tmp_path / "rig"
    rig = f"{rig_program()} --with-parent --link {link}"
    shell = f"{rig} & until test -L {link}; do sleep 0.05; done"
    subprocess.run(["sh", "-c", shell], stdout=subprocess.DEVNULL, timeout=PATIENCE_S)
    end = time.monotonic() + PATIENCE_S
    while link.is_symlink():  # removed when it ends
        assert time.monotonic() < end
        time.sleep(0.02)


def test_a_wrong_command_line_prints_the_usage():
    with pytest.raises(RuntimeError), firmware_rig("--jump-encoder", "yaw@3"):
        pass


@pytest.mark.realtime
def test_a_reply_does_not_wait_for_the_next_turn_of_the_main_loop():
    with rig() as (_, host):
        took = []
        for _ in range(200):
            start = time.monotonic()
            host.poll()
            took.append(time.monotonic() - start)
        # A turn is 1 ms. With a wait for it, every reply would take about one turn, as each request
        # follows the reply before it. A busy machine makes most of them late, and none early.
        assert sorted(took)[len(took) // 10] < 0.45e-3
