"""Test results do not depend on the machine, the shell or the order of tests."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

ROOT = Path(__file__).parents[1]
PRINT_EXAMPLES = "from tests.test_gate import drawn; print(drawn())"


def drawn() -> list[object]:
    """The examples of Hypothesis under the profile of this project."""
    seen: list[object] = []

    @given(st.integers(), st.floats(), st.text(max_size=3))
    def tried(whole: int, real: float, text: str) -> None:
        seen.append((whole, real, text))

    tried()
    return seen


def examples_after(before: str) -> str:
    """The printed examples of a process that first runs ``before``."""
    command = [sys.executable, "-c", f"import tests.conftest; {before}; {PRINT_EXAMPLES}"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def test_examples_do_not_depend_on_the_modules_loaded_before() -> None:
    other_modules = "import heli3dof.rig.profile, heli3dof.experiment.plan"
    assert examples_after("pass") == examples_after(other_modules)


def test_an_example_has_no_deadline() -> None:
    assert settings.default is not None
    assert settings.default.deadline is None
    assert HealthCheck.too_slow in settings.default.suppress_health_check


def test_the_search_profile_draws_random_examples() -> None:
    assert not settings.get_profile("search").derandomize


def test_tests_started_in_the_background_handle_ctrl_c() -> None:
    # A shell does this to commands started with `&`, and child processes inherit ignored signals.
    ignoring = (
        "import signal, subprocess, sys; signal.signal(signal.SIGINT, signal.SIG_IGN);"
        "import tests.conftest; child = 'import signal; print(signal.getsignal(signal.SIGINT))';"
        "sys.exit(subprocess.call([sys.executable, '-c', child]))"
    )
    command = [sys.executable, "-c", ignoring]
    output = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert "default_int_handler" in output
