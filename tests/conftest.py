"""Settings that must be made before numpy is imported, and fixtures for all tests.

- One BLAS thread per process: pytest-xdist already uses all cores. Four workers with four BLAS
  threads each run the small factorisations of the identification forty times slower.
- Private runtime and state folders: an emergency stop of every rig must not reach a flight outside
  the tests or in another worker, and the tests must not access calibrations of real rigs.
- Default handlers of SIGINT and SIGTERM: a shell that starts the tests in the background
  (``make test &``) makes them, and every process they start, ignore Ctrl-C.
- No variables that colour or narrow the output of the terminal: tests compare its text.
"""

from __future__ import annotations

import atexit
import gc
import os
import shutil
import signal
import tempfile

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

for name in ("FORCE_COLOR", "PY_COLORS", "GITHUB_ACTIONS", "NO_COLOR", "COLUMNS", "LINES"):
    os.environ.pop(name, None)

for number, handler in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGTERM, signal.SIG_DFL),
):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, handler)

OWN = tempfile.mkdtemp(prefix="h3t-")
atexit.register(shutil.rmtree, OWN, ignore_errors=True)
for name in ("XDG_RUNTIME_DIR", "XDG_STATE_HOME"):
    os.environ[name] = OWN

import pytest  # noqa: E402
from hypothesis import HealthCheck, settings  # noqa: E402
from hypothesis.internal.conjecture import providers  # noqa: E402

from heli3dof.parallel import core_count  # noqa: E402
from heli3dof.rig.session.stop_stamp import start_command  # noqa: E402
from tests.clock import Clock, installed  # noqa: E402

# The same code gets the same examples: a change must not fail because of a new random example.
# No deadline: a first call may import or compile; pytest-timeout ends a test that hangs.
# For new and more examples: pytest --hypothesis-profile=search.
settings.register_profile(
    "search", derandomize=False, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile(
    "heli3dof", settings.get_profile("search"), derandomize=True, max_examples=50
)
settings.load_profile("heli3dof")
# Hypothesis also draws constants from the loaded modules of the project, which depend on the tests
# that this worker has run before.
providers._get_local_constants = lambda: providers._local_constants


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Return three workers for two cores: many tests wait for real time or another process."""
    return (3 * core_count() + 1) // 2


@pytest.hookimpl(trylast=True)
def pytest_collection_finish() -> None:
    """Exempt what the collection made from garbage collections, and make these rarer.

    Each worker holds 6,300 tests and their modules until it ends. Visiting them cost 6 % of the
    CPU time of the tests, and the collections every 700 new objects another 6 %.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 50, 50)


@pytest.fixture(autouse=True)
def own_command() -> None:
    """Each test is a new command: an emergency stop in an earlier test does not affect it."""
    start_command()


@pytest.fixture
def own_clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """See `tests.clock.installed`."""
    return installed(monkeypatch)
