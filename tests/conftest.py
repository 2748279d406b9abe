"""Before numpy is imported: one BLAS thread per process.

pytest-xdist already fills the cores. Four workers with four spinning BLAS threads each ran the
identification's small factorisations forty times slower than one thread does.
"""

from __future__ import annotations

import os

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

from hypothesis import settings  # noqa: E402

# A first call may import or compile for seconds; pytest-timeout guards against hanging.
settings.register_profile("heli3dof", deadline=None)
settings.load_profile("heli3dof")
