"""The serial driver against emulated rigs at pseudo-terminals, sockets and loops."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import pytest
from heli3dof_drivers.emulator.transport_pty import serve
from heli3dof_drivers.link import handshake, serial_ports
from heli3dof_drivers.link.request_reply import LinkStatistics
from heli3dof_drivers.link.serial_ports import holders

from heli3dof.errors import DeviceError, UsageError
from heli3dof.rig.drivers import load_driver, open_driver
from heli3dof.rig.interface import Command, Flags
from heli3dof.rig.profile import default_profile
from heli3dof.rig.url import parse_url
from tests.drivers.emulated_rigs import RigProcess, emulated_rig
from tests.drivers.emulator.still import still_endpoint
from tests.paths import ROOT
from tests.profiles import END_S, STALL_S

PROFILE = default_profile()
DRIVER = load_driver("serial")


@pytest.fixture(scope="module")
def emulated() -> Iterator[RigProcess]:
    with emulated_rig() as opened:
        yield opened


def fly(rig, periods: int = 20):
    """The last sample. Each exchange waits for its sample as long as a stalled machine may need."""
    rig.arm()
    for k in range(1, periods + 1):
        sample = rig.exchange(Command(k, 2.0, 2.0), time.monotonic() + STALL_S)
    return sample


def test_a_scheme_with_a_plus_belongs_to_the_driver_before_the_plus():
    assert load_driver("serial+socket").scheme == "serial"
    with pytest.raises(UsageError, match="no driver for 'serail:'"):
        load_driver("serail+socket")


def test_the_error_for_a_missing_port_lists_the_ports(monkeypatch):
    with pytest.raises(DeviceError, match=r"/dev/ttyNONE: there is no such port \(ports: "):
        open_driver("serial:///dev/ttyNONE", PROFILE)


def test_a_file_that_is_no_serial_port_is_an_error(tmp_path: Path):
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(DeviceError, match=r"no serial port|not permitted|does not open") as caught:
        open_driver(f"serial://{file}", PROFILE)
    assert caught.value.exit_code == 3


@pytest.mark.skipif(os.geteuid() == 0, reason="root may open everything")
def test_missing_permission_names_the_group(tmp_path: Path):
    file = tmp_path / "port"
    file.touch(mode=0)
    with pytest.raises(DeviceError, match="not permitted") as caught:
        open_driver(f"serial://{file}", PROFILE)
    assert "usermod" in caught.value.fix


def test_wrong_places_and_options_are_usage_errors():
    for url in (
        "serial:", "serial:///dev/ttyACM0?baud=fast", "serial:///dev/ttyACM0?stream=2",
        "serial:///dev/ttyACM0?watchdog_s=20", "serial:///dev/ttyACM0?file=x",
        "serial+nonsense://x",
    ):  # fmt: skip
        with pytest.raises(UsageError):
            open_driver(url, PROFILE)


HOLD = """
import sys, time
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.interface import Command
from heli3dof.rig.profile import default_profile
rig = open_driver(sys.argv[1], default_profile())
rig.arm()
print("armed", flush=True)
for k in range(1, 100_000):
    sample = rig.exchange(Command(k, 3.0, 3.0), 0.0)
    if not sample.flags & 1:
        print(int(sample.flags), *sample.v_applied, flush=True)
        break
"""


def test_estop_reaches_a_rig_whose_port_another_process_holds(emulated: RigProcess):
    url = emulated.url("watchdog_s=0.5")
    flight = subprocess.Popen([sys.executable, "-c", HOLD, url], stdout=subprocess.PIPE, text=True)
    assert flight.stdout is not None
    assert flight.stdout.readline() == "armed\n"
    with pytest.raises(DeviceError, match=f"process {flight.pid} ") as caught:
        open_driver(url, PROFILE)
    assert "busy" in caught.value.what
    assert "estop" in caught.value.fix
    assert flight.pid in [pid for pid, _ in holders(emulated.path)]
    held = {c.what: c for c in DRIVER.examine(parse_url(url))}["held by"]
    assert held.good is False
    assert str(flight.pid) in held.found
    assert str(emulated.process.pid) not in held.found

    confirmation = DRIVER.estop(parse_url(url))
    assert "stop" in confirmation
    assert flight.stdout.readline() == "16 0.0 0.0\n"
    flight.wait(timeout=END_S)
    rig = open_driver(url, PROFILE)
    assert rig.read().flags == Flags.ESTOP
    rig.close()


def test_estop_reaches_a_rig_whose_holder_hangs_with_the_line_full(emulated: RigProcess):
    url = emulated.url("watchdog_s=0.5")
    flight = subprocess.Popen([sys.executable, "-c", HOLD, url], stdout=subprocess.PIPE, text=True)
    assert flight.stdout is not None
    assert flight.stdout.readline() == "armed\n"
    flight.send_signal(signal.SIGSTOP)
    time.sleep(0.4)  # its samples are not read
    try:
        assert "the rig confirmed it" in DRIVER.estop(parse_url(url))
    finally:
        flight.kill()
        flight.wait(timeout=END_S)


def test_estop_reaches_a_rig_that_no_process_holds(emulated: RigProcess):
    url = parse_url(emulated.url())
    assert "the rig confirmed it" in DRIVER.estop(url)
    rig = open_driver(url, PROFILE)
    assert rig.read().flags == Flags.ESTOP
    assert fly(rig).flags == Flags.ENABLED
    rig.close()


def test_estop_of_a_missing_port_is_a_device_error():
    with pytest.raises(DeviceError, match="no such port"):
        DRIVER.estop(parse_url("serial:///dev/ttyNONE"))


def test_a_rig_that_fails_during_a_run_is_a_device_error():
    with emulated_rig() as mortal:
        rig = open_driver(mortal.url(), PROFILE)
        fly(rig)
        mortal.end()
        with pytest.raises(DeviceError, match="is gone"):
            fly(rig)
        rig.close()


@pytest.fixture
def served() -> Iterator[str]:
    """An emulated rig at a TCP port."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        going = True

        def accept() -> None:
            connection, _ = server.accept()
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            with connection:
                serve(still_endpoint(), connection.fileno(), lambda: going)

        thread = threading.Thread(target=accept, daemon=True)
        thread.start()
        yield "{}:{}".format(*server.getsockname())
        going = False
        thread.join(timeout=5)


def test_a_rig_at_a_socket_runs_and_a_closed_socket_is_an_error(served: str):
    rig = open_driver(f"serial+socket://{served}?watchdog_s=0.5", PROFILE)
    assert fly(rig).sequence == 20
    rig.close()


def test_a_socket_without_a_listener():
    with pytest.raises(DeviceError, match="does not open"):
        open_driver("serial+socket://127.0.0.1:1", PROFILE)


def test_a_loop_that_echoes_requests_is_not_a_rig(monkeypatch):
    monkeypatch.setattr(handshake, "TRIES", 2)
    with pytest.raises(DeviceError, match="not a rig"):
        open_driver("serial+loop://", PROFILE)


def test_a_spy_logs_the_bytes(emulated: RigProcess, tmp_path: Path):
    file = tmp_path / "bytes.txt"
    rig = open_driver(f"serial+spy://{emulated.path}?file={file}&watchdog_s=0.5", PROFILE)
    assert fly(rig).flags & Flags.ENABLED
    rig.close()
    assert "TX" in file.read_text()


def test_doctors_checks_of_a_port(emulated: RigProcess, monkeypatch, tmp_path: Path):
    result = {c.what: c for c in DRIVER.examine(parse_url(emulated.url()))}
    assert result["port"].good
    assert result["permission"].good
    assert result["latency timer"].good
    # The emulated rig has its own end open without a lock.
    assert result["held by"].good is None
    assert str(emulated.process.pid) in result["held by"].found
    assert not DRIVER.examine(parse_url("serial:///dev/ttyNONE"))[0].good

    timer = tmp_path / "latency_timer"
    timer.write_text("16\n")
    monkeypatch.setattr(serial_ports, "LATENCY_FILES", (str(timer),))
    slow = {c.what: c for c in DRIVER.examine(parse_url(emulated.url()))}["latency timer"]
    assert slow.good is False
    assert slow.fix == f"echo 1 | sudo tee {timer}"


def test_finding_ports_imports_nothing_heavy():
    code = (
        "import sys; from heli3dof_drivers.serial_port import SerialDriver; SerialDriver().find();"
        "print(sorted({'numpy', 'pydantic', 'numba'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_the_page_names_every_option_and_every_counter():
    page = (ROOT / "docs" / "reference" / "serial.md").read_text(encoding="utf-8")
    rows = re.findall(r"^[|-] (`[^|:]*`)", page, re.MULTILINE)
    named = set(re.findall(r"`(\w+?)(?:_…_s)?`", "".join(rows)))
    counted = {f.name for f in fields(LinkStatistics)}
    assert set(DRIVER.options) <= named
    assert named - set(DRIVER.options) <= counted
    assert counted - named == {"sent", "received", "commands"}  # self-explanatory
    assert f"for up to {handshake.TRIES * handshake.REPLY_TIMEOUT_S:g} s" in page
