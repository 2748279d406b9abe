"""Before numpy is imported: one BLAS thread per process; and folders of the tests' own.

pytest-xdist already fills the cores. Four workers with four spinning BLAS threads each ran the
identification's small factorisations forty times slower than one thread does.

A test that stops every rig must not reach one that flies outside the tests, or in another worker;
and calibrations of real rigs are not the tests' to read or write.
"""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

OWN = tempfile.mkdtemp(prefix="h3t-")
atexit.register(shutil.rmtree, OWN, ignore_errors=True)
for name in ("XDG_RUNTIME_DIR", "XDG_STATE_HOME"):
    os.environ[name] = OWN

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

from tests.clock import Clock, installed  # noqa: E402

# A first call may import or compile for seconds; pytest-timeout guards against hanging.
settings.register_profile("heli3dof", deadline=None)
settings.load_profile("heli3dof")


@pytest.fixture
def own_clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """See `tests.clock.installed`."""
    return installed(monkeypatch)
