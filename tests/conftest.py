"""Before numpy is imported: one BLAS thread per process; and folders of the tests' own.

pytest-xdist already fills the cores. Four workers with four spinning BLAS threads each ran the
identification's small factorisations forty times slower than one thread does.

A test that stops every rig must not reach one that flies outside the tests, or in another worker;
and calibrations of real rigs are not the tests' to read or write.

Whoever starts the tests in the background (``make test &``) may have them ignore Ctrl-C, and every
process of theirs with them; a flight that was started so is right to fly on. Where they are started
may colour, or narrow, what is looked at for its words.
"""

from __future__ import annotations

import atexit
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

from heli3dof.rig.session.stop_stamp import start_command  # noqa: E402
from tests.clock import Clock, installed  # noqa: E402

# Same code, same examples: a change is not to fail by what another draw finds in another's work.
# Nor by the clock: a first call may import or compile; pytest-timeout guards against hanging.
# To look for more: pytest --hypothesis-profile=search.
settings.register_profile(
    "search", derandomize=False, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("heli3dof", settings.get_profile("search"), derandomize=True)
settings.load_profile("heli3dof")
# Hypothesis would mix in the constants of whichever of our modules are loaded by then: what else
# this worker has tested would decide.
providers._get_local_constants = lambda: providers._local_constants


@pytest.fixture(autouse=True)
def own_command() -> None:
    """Each test is a command of its own: an emergency stop of the one before does not bind it."""
    start_command()


@pytest.fixture
def own_clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """See `tests.clock.installed`."""
    return installed(monkeypatch)
