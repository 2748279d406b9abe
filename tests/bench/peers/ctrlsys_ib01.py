"""Adapter of ctrlsys (SLICOT's IB01AD, IB01BD), a black box: MOESP for A, C, N4SID for B, D.

Settings, by SLICOT's pages of IB01AD and IB01BD:

- the combined method ('C' in IB01BD, so 'M' in IB01AD), as in their example program and in moen4
- NOBR, the block rows, must exceed the order N, eight for the rig; 2 N is the interfaces' default
- 'C', the Cholesky algorithm, is the fast default
- JOBCK 'C' requests the covariances; the Kalman gain then follows by the same Riccati equation.
  Where it computes the gain itself, version 1.1.1 corrupts its heap at these sizes.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from tests.bench.peers.interface import Meter, read_task, write_linear
from tests.bench.peers.sampling import held_means

INTERVAL_S = 0.04
ORDER = 8
BLOCK_ROWS = 16


def main(task_file: str, found_file: str) -> None:
    import ctrlsys
    from scipy.linalg import solve_discrete_are

    task = read_task(Path(task_file))
    factor = round(INTERVAL_S / task.dt)
    u, y = held_means(task.voltage, task.angle, factor)
    u0, y0 = u.mean(axis=0), y.mean(axis=0)
    U, Y = np.asfortranarray(u - u0), np.asfortranarray(y - y0)
    m, l = U.shape[1], Y.shape[1]
    meter = Meter()
    with meter.fitting():
        _, R, _, _, info = ctrlsys.ib01ad(
            "M", "C", "N", "O", "N", "N", BLOCK_ROWS, m, l, U, Y, 0.0, -1.0
        )
        if info:
            sys.exit(f"IB01AD: info {info}")
        A, C, B, D, Q, Ry, S, _, _, info = ctrlsys.ib01bd(
            "C", "A", "C", BLOCK_ROWS, ORDER, m, l, len(U), np.asfortranarray(R), 0.0
        )
        if info:
            sys.exit(f"IB01BD: info {info}")
        P = solve_discrete_are(A.T, C.T, Q, Ry, s=S)
        K = np.linalg.solve(C @ P @ C.T + Ry, (A @ P @ C.T + S).T).T
    write_linear(
        Path(found_file), meter,
        f"IB01AD 'M', IB01BD 'C', order {ORDER}, {BLOCK_ROWS} block rows, "
        f"every {INTERVAL_S * 1e3:g} ms",
        interval_s=INTERVAL_S, u0=u0, y0=y0, A=A, B=B, C=C, D=D, K=K, S=Ry,
    )  # fmt: skip


if __name__ == "__main__":
    main(*sys.argv[1:])
