"""The same core as a microcontroller's image, its UART on a PTY: `make test-qemu`.

The test uses the peripherals of QEMU's board: clock, UART and GPIO with their interrupts. The keys
of the kit replace the lines of the amplifier and of an encoder; at the start all of them are down.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from heli3dof_drivers.link.frames import (
    Ack,
    Arm,
    Cause,
    Code,
    Disarm,
    Estop,
    Hello,
    Report,
    SampleFrame,
    Status,
    wire,
)

from .building import build
from .test_program import Host

QEMU, GCC, NM = "qemu-system-arm", "arm-none-eabi-gcc", "arm-none-eabi-nm"
MISSING = [program for program in (QEMU, GCC, NM) if not shutil.which(program)]
SEEN_S = 0.02
FAULT, STALL, STOP, ENCODER_A, ENCODER_B = "up", "down", "ctrl", "left", "right"

if os.environ.get("HELI3DOF_QEMU") != "1":
    pytest.skip("opt-in: make test-qemu", allow_module_level=True)


class Board:
    """A board in its emulator, with the emulator's console (QMP: one JSON document per line)."""

    def __init__(self, image: str, debugger: str) -> None:
        self.image, self.debugger = image, debugger
        self.asked: Callable[[], object] = lambda: None
        """A question that the board has answered when this returns: it has looked at its lines"""
        self.process = subprocess.Popen(
            [QEMU, "-M", "lm3s6965evb", "-kernel", image, "-display", "none", "-serial", "pty",
             "-qmp", "stdio", "-gdb", f"unix:{debugger},server=on,wait=off"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip
        self.tell("qmp_capabilities")
        ports = self.tell("query-chardev")
        self.path = next(d["filename"] for d in ports if d["label"] == "serial0")[len("pty:") :]

    def tell(self, command: str, **arguments: Any) -> Any:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        request = json.dumps({"execute": command, "arguments": arguments})
        self.process.stdin.write(request + "\n")
        self.process.stdin.flush()
        for line in self.process.stdout:
            answer = json.loads(line) if line.startswith("{") else {}
            assert "error" not in answer, answer
            if "return" in answer:
                return answer["return"]
        raise AssertionError(f"QEMU ended at {command}")

    def key(self, name: str, down: bool) -> None:
        what = {"down": down, "key": {"type": "qcode", "data": name}}
        self.tell("input-send-event", events=[{"type": "key", "data": what}])
        time.sleep(SEEN_S)
        for _ in range(2):  # on a busy machine the emulated board may stall
            self.asked()

    def hang(self) -> None:
        """A debugger sends the processor into an endless loop, and lets it run on."""
        names = subprocess.run([NM, self.image], capture_output=True, text=True, check=True).stdout
        loop = next(line.split()[0] for line in names.splitlines() if line.endswith(" fault"))
        with socket.socket(socket.AF_UNIX) as debugger:
            debugger.connect(self.debugger)
            xml = "qXfer:features:read:target.xml:0,ff"  # without it QEMU knows no register 15
            for request in (xml, f"Pf={bytes.fromhex(loop)[::-1].hex()}", "c"):
                checksum = sum(request.encode()) % 256
                debugger.sendall(f"+${request}#{checksum:02x}".encode())
                time.sleep(SEEN_S)

    def press(self, name: str) -> None:
        self.key(name, down=True)
        self.key(name, down=False)


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Board]:
    if MISSING:
        pytest.fail(f"{MISSING[0]} is not there: apt-get install {QEMU} gcc-arm-none-eabi")
    board = Board(
        str(build("heli3dof-lm3s6965.elf") / "heli3dof-lm3s6965.elf"), str(tmp_path / "gdb")
    )
    yield board
    board.process.kill()
    board.process.wait()


@pytest.fixture
def host(board: Board) -> Iterator[Host]:
    host = Host(board.path)
    while not host.port.in_waiting:  # QEMU checks once a second whether its PTY is open
        host.port.write(wire(Hello(6)))
        time.sleep(0.1)
    host.port.reset_input_buffer()
    board.asked = host.identity
    for key in (FAULT, STALL, STOP, ENCODER_A, ENCODER_B):
        board.press(key)
    host.port.reset_input_buffer()
    yield host
    host.port.close()


def test_hello_arm_command_sample_and_the_watchdogs_expiry(host: Host):
    identity = host.identity()
    assert identity.model.rstrip(b"\0") == b"EK-LM3S6965"
    assert re.fullmatch(rb"[0-9a-f]{12}\0{4}", identity.serial)
    assert host.arm().code == Code.OK
    host.command(7_000_000, -24_000_001)
    sample = host.poll()
    assert (sample.front_uV, sample.back_uV, sample.echo) == (7_000_000, -24_000_000, 1)
    assert sample.flags == 1 | 32
    time.sleep(0.2)
    ramping = host.poll()
    assert (ramping.cause, ramping.flags) == (Cause.WATCHDOG, 8)
    assert 0 < ramping.front_uV < 7_000_000
    time.sleep(0.3)
    assert host.poll().front_uV == 0
    report = host.ask(Status(12), Report)
    assert isinstance(report, Report)
    assert (report.expiries, report.malformed) == (1, 0)


def test_its_clock_keeps_time_and_its_stream_follows_it(host: Host):
    host.arm(period_us=2000)
    begin = time.monotonic()
    samples = [host.hear(SampleFrame) for _ in range(500)]
    assert time.monotonic() - begin == pytest.approx(1.0, rel=0.2)
    numbers = [s.number for s in samples]
    assert numbers == sorted(set(numbers))
    first, last = samples[0], samples[-1]
    ticks = last.time_us - first.time_us  # type: ignore[union-attr]
    assert ticks / (last.number - first.number) == pytest.approx(2000, rel=0.02)
    assert host.ask(Disarm(3), Ack).code == Code.OK  # type: ignore[union-attr]


def test_its_interrupts_count_an_encoders_edges(board: Board, host: Host):
    quarters = [(ENCODER_A, True), (ENCODER_B, True), (ENCODER_A, False), (ENCODER_B, False)]
    before = host.poll().roll
    for key, down in 3 * quarters:  # a pressed key pulls the line low
        board.key(key, down)
    assert host.poll().roll == before + 12
    for key, down in reversed(quarters):
        board.key(key, not down)
    assert host.poll().roll == before + 8


@pytest.mark.parametrize(
    ("key", "cause", "flag"),
    [(FAULT, Cause.OVERCURRENT, 2), (STALL, Cause.STALL, 4), (STOP, Cause.BUTTON, 16)],
)
def test_its_lines_stop_it(board: Board, host: Host, key: str, cause: Cause, flag: int):
    host.arm()
    host.command()
    board.press(key)
    sample = host.poll()
    assert (sample.front_uV, sample.cause, sample.flags) == (0, cause, flag)
    assert host.arm().code == Code.OK


def test_an_estop_stops_it(host: Host):
    host.arm()
    host.command()
    answer = host.ask(Estop(5, Cause.SATURATED), Ack)
    assert isinstance(answer, Ack)
    assert (answer.flags, answer.cause) == (16, Cause.SATURATED)
    assert host.poll().front_uV == 0


def test_after_a_reset_it_is_idle_with_another_boot_number_and_refuses_old_tickets(
    board: Board, host: Host
):
    before = host.identity()
    host.arm()
    host.command()
    board.tell("system_reset")
    time.sleep(0.3)
    after = host.found_again()
    assert after.boot != before.boot
    assert not after.flags & 1
    answer = host.ask(Arm(4, before.ticket, 0, 0), Ack)
    assert answer.code == Code.STALE_TICKET  # type: ignore[union-attr]


def test_a_processor_that_hangs_restarts_at_zero_volts(board: Board, host: Host):
    before = host.identity()
    host.arm()
    host.command()
    board.hang()
    time.sleep(0.3)
    after = host.found_again()
    assert after.boot != before.boot
    sample = host.poll()
    assert (sample.front_uV, sample.flags & 1) == (0, 0)
    assert sample.time_us < 1_000_000
