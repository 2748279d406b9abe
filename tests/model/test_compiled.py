"""Compilation: inlined leaves, the cache key, and the parts of numba that it needs."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numba
import numpy as np

from heli3dof.model.compiled import _digest, compiled
from heli3dof.model.effects import terms
from heli3dof.model.estimation import ekf_quantised, quantised_measurement
from heli3dof.model.physics import rigid_body, rotor
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.rig.profile import default_profile


def _add(row: Any, out: Any) -> None:
    for i in range(row.shape[0]):
        out[i] += row[i]


add = compiled(_add, leaf=True)


def _sum_rows(a: Any) -> Any:
    out = np.zeros(a.shape[1])
    for k in range(a.shape[0]):
        add(a[k], out)
    return out


sum_rows = compiled(_sum_rows)


def test_a_leaf_accepts_rows_of_its_callers_arrays() -> None:
    a = np.arange(12.0).reshape(4, 3)
    assert sum_rows(a).tolist() == [18.0, 22.0, 26.0]


def test_a_leaf_does_not_change_the_reference_counts_of_arrays() -> None:
    a = np.arange(12.0).reshape(4, 3)
    before = sys.getrefcount(a)
    for _ in range(50):
        out = sum_rows(a)
    assert sys.getrefcount(a) == before
    assert sys.getrefcount(out) == 2  # the name, and the argument


def test_compiled_accelerations_equal_those_in_python() -> None:
    rng = np.random.default_rng(1)
    structure = Structure(default_profile(), tuple(terms(["aero.inflow", "drag.quadratic.yaw"])))
    s, *effects = structure.arguments(structure.start)
    free = np.ones(3, dtype=bool)
    for _ in range(20):
        s[2:8] = rng.uniform(-0.6, 0.6, 6)
        one, other = np.empty(3), np.empty(3)
        w = np.zeros((3, 3))
        torque = rng.standard_normal(3)
        rigid_body.body_accelerations.py_func(s, np.array([1.0, 1.2]), torque, free, one)
        rigid_body.body_accelerations(s, np.array([1.0, 1.2]), torque, free, other)
        np.testing.assert_allclose(one, other, rtol=1e-12)
        rigid_body.accelerations(s, *effects, free, w[0], w[1], w[2])
        assert np.isfinite(w).all()


def test_compiled_parts_of_the_filter_equal_those_in_python() -> None:
    rng = np.random.default_rng(2)
    A, a2 = rng.standard_normal((3, 6)), np.array([0.1, 0.2, 0.3])
    half = rng.standard_normal((6, 6))
    one, other = half @ half.T, half @ half.T
    h, eye = 0.002, np.eye(3)
    Phi = np.block([[eye, h * eye], [h * A[:, :3], eye + h * A[:, 3:]]])
    drive = np.kron([[h**3 / 3, h**2 / 2], [h**2 / 2, h]], np.diag(a2))
    whole = Phi @ one @ Phi.T + drive
    ekf_quantised.propagate_covariance.py_func(one, A, h, a2, np.zeros((3, 6)))
    ekf_quantised.propagate_covariance(other, A, h, a2, np.zeros((3, 6)))
    np.testing.assert_allclose(one, other, rtol=1e-12)
    np.testing.assert_allclose(one, whole, rtol=1e-12)
    for lo, hi, S in ((-0.2, 0.3, 0.04), (1.4, 1.9, 0.09)):
        np.testing.assert_allclose(
            quantised_measurement.interval.py_func(lo, hi, S),
            quantised_measurement.interval(lo, hi, S),
            rtol=1e-10,
        )
    # F rises linearly by 1 N in 0.1 s at 10 N/s; the target is far away.
    assert rotor.lagged(0.0, 100.0, 0.05, 10.0, 0.1) == 1.0


def test_the_digest_covers_called_functions_and_numbers() -> None:
    assert _digest(sum_rows) == _digest(_sum_rows)
    assert _digest(_sum_rows) != _digest(_add)
    assert _digest(rotor.thrusts) != _digest(rotor.lagged)


CALLER = """
    from heli3dof.model.compiled import compiled
    from called import called

    def _twice(x):
        return 2.0 * called(x)

    twice = compiled(_twice)
    print(twice(1.0), sum(twice.stats.cache_hits.values()))
    """
CALLED = """
    from heli3dof.model.compiled import compiled
    def _called(x):
        return x + {added}
    called = compiled(_called, leaf=True)
    """


def test_a_change_in_a_called_function_recompiles_its_callers(tmp_path: Path) -> None:
    (tmp_path / "caller.py").write_text(textwrap.dedent(CALLER))
    printed = []
    # A byte-code file written in the same second, of a source of the same size, counts as current.
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    for added in (1.0, 1.0, 5.0):
        (tmp_path / "called.py").write_text(textwrap.dedent(CALLED.format(added=added)))
        done = subprocess.run(
            [sys.executable, str(tmp_path / "caller.py")],
            capture_output=True, text=True, check=True, env=environment,
        )  # fmt: skip
        printed.append(done.stdout.split())
    assert printed == [["4.0", "0"], ["4.0", "1"], ["12.0", "0"]]


def test_numba_has_the_private_option_that_leaves_need() -> None:
    from numba.core.cpu import CPUTargetOptions

    assert hasattr(CPUTargetOptions, "_nrt"), (
        f"numba {numba.__version__} has no option _nrt: heli3dof/model/compiled.py compiles leaves "
        "with it. Find another way to disable reference counting, or keep numba below this version "
        "in pyproject.toml."
    )
