"""A session locks its rig and answers a second terminal at any time."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from heli3dof.errors import DeviceError
from heli3dof.rig.session.client import Request, Running, lives, running, state
from heli3dof.rig.session.paths import device_name, runtime_folder
from heli3dof.rig.session.server import BACKLOG, Session
from heli3dof.rig.session.stop_stamp import ALL, leave_stamp, stopped_since
from tests.rig.processes import suspend

DEVICE = "serial:///dev/null?baud=9600"
HOLDER = f"""
import sys, time
from heli3dof.rig.session.server import BACKLOG, Session
from heli3dof.rig.session.stop_stamp import ALL, leave_stamp, stopped_since
from tests.rig.processes import suspend
session = Session({DEVICE!r}, doing="heli3dof run rich")
print("held", flush=True)
time.sleep(600)
"""


@pytest.fixture
def session() -> Iterator[Session]:
    with Session(DEVICE, doing="heli3dof run rich") as held:
        yield held


@pytest.fixture
def other_process() -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen([sys.executable, "-c", HOLDER], stdout=subprocess.PIPE, text=True) as p:
        assert p.stdout is not None
        assert p.stdout.readline() == "held\n"
        yield p
        p.kill()


def test_options_and_links_do_not_change_the_device_name(tmp_path):
    link = tmp_path / "by-id"
    link.symlink_to("/dev/null")
    assert device_name(DEVICE) == device_name(f"serial://{link}")
    assert device_name(DEVICE) != device_name("serial:///dev/zero")
    assert device_name(DEVICE) != device_name("usb:///dev/null")


@pytest.fixture
def runtime(monkeypatch, tmp_path) -> Path:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path


def test_only_its_owner_can_read_the_runtime_folder(runtime):
    (runtime / "heli3dof").mkdir(mode=0o755)
    assert runtime_folder() == runtime / "heli3dof"
    assert runtime_folder().stat().st_mode & 0o777 == 0o700


def test_a_runtime_folder_that_is_a_link_is_refused(runtime, tmp_path_factory):
    (runtime / "heli3dof").symlink_to(tmp_path_factory.mktemp("elsewhere"))
    with pytest.raises(DeviceError, match="another user"):
        runtime_folder()


def test_without_xdg_runtime_dir_the_folder_is_temporary(monkeypatch, tmp_path):
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    assert runtime_folder() == tmp_path / f"heli3dof-{os.getuid()}"
    monkeypatch.delattr(os, "getuid")  # temporary files are a user's own there
    assert runtime_folder() == tmp_path / "heli3dof"


def test_a_second_session_gets_an_error_that_names_the_first(session):
    with pytest.raises(DeviceError) as caught:
        Session("serial:///dev/null")
    assert f"pid {os.getpid()} runs `heli3dof run rich` since 2" in caught.value.what
    assert caught.value.exit_code == 3


def test_a_rig_is_free_after_its_session(session):
    session.close()
    session.close()
    Session(DEVICE).close()


def test_a_killed_session_frees_the_rig_and_is_not_listed(other_process):
    assert [s.pid for s in running(DEVICE)] == [other_process.pid]
    with pytest.raises(DeviceError, match=f"pid {other_process.pid} runs"):
        Session(DEVICE)
    other_process.send_signal(signal.SIGKILL)
    other_process.wait()
    assert running(DEVICE) == []
    Session(DEVICE).close()


def test_sessions_are_listed_with_their_command(session):
    (result,) = running(DEVICE)
    assert (result.device, result.pid, result.doing) == (DEVICE, os.getpid(), "heli3dof run rich")
    assert running("serial:///dev/zero") == []


def test_private_rigs_do_not_lock_each_other(runtime):
    with Session("mock:", private=True) as one, Session("mock:?seed=2", private=True) as two:
        assert (one.device, two.device) == ("mock:", "mock:?seed=2")
        assert sorted(s.device for s in running("mock:")) == ["mock:", "mock:?seed=2"]
    assert running("mock:") == []
    assert not list(runtime_folder().iterdir())


def test_a_stop_of_a_private_rig_is_confirmed_before_it_is_armed_and_forbids_it(runtime):
    with Session("mock:", private=True) as session:
        (result,) = running("mock:")
        question = Request(result, {"do": "estop", "reason": "smoke"})
        assert question.answer(5) == {"stopped": "before it had armed its emulated rig"}
        assert session.begin_to_arm() == "smoke"


def test_the_loop_confirms_a_stop_of_a_private_rig_that_is_being_armed(runtime):
    with Session("mock:", private=True) as session:
        assert session.begin_to_arm() is None
        (result,) = running("mock:")
        assert Request(result, {"do": "estop", "reason": "smoke"}).answer(0.2) is None
        assert session.begin_to_arm() == "smoke"


def test_a_lock_file_that_cannot_be_removed_does_not_block_a_session(runtime, monkeypatch):
    """As Windows does while another process reads it."""

    def refuse(path: Path, missing_ok: bool = False) -> None:
        raise PermissionError(f"{path} is open")

    monkeypatch.setattr(Path, "unlink", refuse)
    monkeypatch.setattr(Path, "replace", refuse)
    for _ in range(2):
        with Session(DEVICE), Session("mock:", private=True):
            assert len(running()) == 2
            leave_stamp([ALL], "smoke")
        assert running() == []
    assert stopped_since(0, []) is not None


def test_a_request_without_the_key_is_dropped(session):
    (result,) = running(DEVICE)
    stranger = replace(result, key="another")
    assert Request(stranger, {"do": "estop"}).answer(5) is None
    assert session.stop_reason is None


def test_the_state_is_that_of_the_session(session):
    session.state = lambda: {"roll_deg": 1.5}
    (result,) = running(DEVICE)
    assert state(result, timeout_s=5) == {"roll_deg": 1.5}


def test_an_error_in_the_state_does_not_end_the_session(session):
    def broken() -> dict[str, float]:
        raise ValueError("no sample yet")

    session.state = broken
    (result,) = running(DEVICE)
    assert state(result, timeout_s=5) is None
    assert Request(result, {"do": "state"}).answer(5) == {"error": "ValueError: no sample yet"}


def test_a_stop_is_answered_after_it_was_executed(session):
    (result,) = running(DEVICE)
    question = Request(result, {"do": "estop", "reason": "smoke"})
    deadline = time.monotonic() + 60
    while session.stop_reason is None and time.monotonic() < deadline:
        time.sleep(1e-3)
    assert session.stop_reason == "smoke"
    threading.Timer(0.05, session.confirm, ["by the loop"]).start()
    assert question.answer(5) == {"stopped": "by the loop"}


def test_a_client_gives_up_a_session_that_never_confirms(session):
    (result,) = running(DEVICE)
    start = time.monotonic()
    assert Request(result, {"do": "estop"}).answer(0.2) is None
    assert time.monotonic() - start < 10


def test_a_waiting_client_gets_an_answer_when_the_session_ends(session):
    (result,) = running(DEVICE)
    question = Request(result, {"do": "estop"})
    while session.stop_reason is None:
        time.sleep(1e-3)
    session.close()
    assert "over" in question.answer(5)


def connected(session: Running) -> socket.socket:
    return socket.create_connection(("127.0.0.1", session.port))


@pytest.mark.parametrize("rubbish", [b"", b"\n", b"{", b"[1]", b'{"do": 1}\n', b"\xff" * 9000])
def test_an_invalid_request_is_dropped_and_the_next_is_answered(session, rubbish):
    (result,) = running(DEVICE)
    with connected(result) as line:
        line.sendall(rubbish)
        with contextlib.suppress(OSError):  # it may have hung up already
            line.shutdown(socket.SHUT_WR)
        assert state(result, timeout_s=5) == {}


def test_silent_clients_delay_no_other(session):
    (result,) = running(DEVICE)
    lines = [connected(result) for _ in range(8)]
    assert state(result, timeout_s=5) == {}
    for line in lines:
        line.close()


def test_a_hanging_session_is_alive_and_does_not_answer(other_process):
    (result,) = running(DEVICE)
    suspend(other_process)
    try:
        assert lives(result)
        assert state(result, timeout_s=0.1) is None
        with pytest.raises(DeviceError, match="busy"):
            Session(DEVICE)
    finally:
        other_process.send_signal(signal.SIGCONT)
    assert state(result, timeout_s=5) == {}


def test_a_session_that_hangs_for_long_is_alive(other_process):
    (result,) = running(DEVICE)
    suspend(other_process)
    lines = []
    try:
        with contextlib.suppress(TimeoutError):
            for _ in range(2 * BACKLOG):
                lines.append(socket.create_connection(("127.0.0.1", result.port), 0.2))
        assert len(lines) < 2 * BACKLOG
        assert lives(result)
        assert [s.pid for s in running(DEVICE)] == [other_process.pid]
    finally:
        for line in lines:
            line.close()
        other_process.kill()
    other_process.wait()
    assert not lives(result)


def test_one_of_many_simultaneous_sessions_gets_the_rig():
    together = threading.Barrier(8)
    won: list[Session] = []

    def want() -> None:
        together.wait()
        with contextlib.suppress(DeviceError):
            won.append(Session(DEVICE))

    threads = [threading.Thread(target=want) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(won) == 1
    won[0].close()


@settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    max_examples=50,
)
@given(noise=st.binary(max_size=6000))
def test_no_bytes_keep_a_session_from_answering(session, noise):
    (result,) = running(DEVICE)
    with connected(result) as line, contextlib.suppress(BrokenPipeError, ConnectionResetError):
        line.sendall(noise)
    assert state(result, timeout_s=5) == {}
    assert session.stop_reason is None
