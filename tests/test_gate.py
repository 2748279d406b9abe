"""What the tests promise of themselves: the same code passes again, wherever and after whatever."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

ROOT = Path(__file__).parents[1]
TELL = "from tests.test_gate import drawn; print(drawn())"


def drawn() -> list[object]:
    """What Hypothesis tries as our profile sets it."""
    seen: list[object] = []

    @given(st.integers(), st.floats(), st.text(max_size=3))
    def tried(whole: int, real: float, text: str) -> None:
        seen.append((whole, real, text))

    tried()
    return seen


def told(before: str) -> str:
    command = [sys.executable, "-c", f"import tests.conftest; {before}; {TELL}"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def test_the_same_examples_are_tried_again_whatever_was_tested_before() -> None:
    assert told("pass") == told("import heli3dof.rig.profile, heli3dof.experiment.plan")


def test_an_example_may_take_its_time() -> None:
    assert settings.default is not None
    assert settings.default.deadline is None
    assert HealthCheck.too_slow in settings.default.suppress_health_check


def test_chance_is_there_for_who_asks_for_it() -> None:
    assert not settings.get_profile("search").derandomize


def test_who_starts_the_tests_in_the_background_does_not_take_ctrl_c_from_them() -> None:
    # As a shell does with what it starts by `&`: an ignored signal is ignored by every child.
    ignoring = (
        "import signal, subprocess, sys; signal.signal(signal.SIGINT, signal.SIG_IGN);"
        "import tests.conftest; child = 'import signal; print(signal.getsignal(signal.SIGINT))';"
        "sys.exit(subprocess.call([sys.executable, '-c', child]))"
    )
    command = [sys.executable, "-c", ignoring]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert "default_int_handler" in said
