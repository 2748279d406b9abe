"""Without POSIX-only functions, rigs fly, are stopped, recorded, identified and diagnosed.

See `tests.posix_free` for the removed functions, and for the limits of this test.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from heli3dof.recording.mcap_files.reader import read_recording
from tests.paths import ROOT
from tests.profiles import END_S, PATIENT, START_S, write_profile

RUN = [sys.executable, str(ROOT / "tests" / "posix_free.py"), "heli3dof"]
MOCK = "mock:?watchdog_s=1&start=level"
PLAN = """
name = "short"
[[segment]]
kind = "hold"
duration_s = 6.0
[[segment]]
kind = "multisine"
yaw_deg = 20.0
duration_s = 10.0
"""


@pytest.fixture
def env(tmp_path: Path) -> Mapping[str, str]:
    return os.environ | {"XDG_RUNTIME_DIR": str(tmp_path), "XDG_STATE_HOME": str(tmp_path)}


def document(env: Mapping[str, str], *words: object, code: int = 0) -> Any:
    """The JSON document of a command."""
    command = [*RUN, *map(str, words), "--json"]
    done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=END_S)
    assert done.returncode == code, done.stderr
    return json.loads(done.stdout)


def test_posix_only_functions_are_removed() -> None:
    looks = (
        "import os, socket, tests.posix_free as free; free.take_away()\n"
        "for name in free.MODULES:\n"
        "    try: __import__(name)\n"
        "    except ImportError: continue\n"
        "    raise SystemExit(name)\n"
        "assert not hasattr(os, 'fork') and not hasattr(os, 'sched_setscheduler')\n"
        "assert not hasattr(socket, 'AF_UNIX')"
    )
    subprocess.run([sys.executable, "-c", looks], cwd=ROOT, check=True)


@pytest.mark.realtime
def test_a_flight_in_real_time_is_watched_and_stopped_from_a_second_process(
    env: Mapping[str, str], tmp_path: Path
) -> None:
    path = tmp_path / "flight.mcap"
    command = [*RUN, "run-step", "--roll", "5", "--device", MOCK, "-o", str(path), "--quiet"]
    command += ["--profile", str(write_profile(tmp_path / "rig.toml", **PATIENT))]
    with subprocess.Popen(command, env=env) as flight:
        until = time.monotonic() + START_S
        while True:
            seen = document(env, "monitor", "--device", "mock:", "--seconds", "0")
            if seen["pid"] == flight.pid and seen["last"].get("phase") == "flying":
                break
            assert flight.poll() is None
            assert time.monotonic() < until
        (session,) = document(env, "devices")["sessions"]
        assert session["pid"] == flight.pid
        answer = document(env, "estop", "--reason", "smoke")
        assert [s["device"] for s in answer["stopped"]] == [session["device"]]
        assert flight.wait(END_S) == 4
    recording = read_recording(path)
    assert recording.meta["outcome"] == "tripped"
    assert "smoke" in recording.meta["outcome_details"]["detail"]


def test_a_rig_is_zeroed_and_examined(env: Mapping[str, str]) -> None:
    assert document(env, "zero", "--device", "mock:")["counts_at_rest"] == [0, 0, 0]
    checks = subprocess.run(
        [*RUN, "doctor", "--device", MOCK, "--json"], env=env, capture_output=True, text=True
    )
    result = json.loads(checks.stdout)
    assert result["schema"] == "heli3dof.doctor/1", result
    assert result["opened"]


def test_a_flight_is_identified_and_diagnosed(env: Mapping[str, str], tmp_path: Path) -> None:
    path, plan = tmp_path / "flight.mcap", tmp_path / "plan.toml"
    plan.write_text(PLAN, encoding="utf-8")
    profile = write_profile(tmp_path / "rig.toml", rate_hz=250.0)
    words = (plan, "--device", "mock:?speed=max", "--profile", profile)
    assert document(env, "run", *words, "-o", path)["outcome"] == "completed"
    assert document(env, "identify", path, "-o", tmp_path / "model.json")["models"]
    result = document(env, "diagnose", "--quick", path, "-o", tmp_path / "extended.json")
    assert result["schema"] == "heli3dof.diagnosis/1"
