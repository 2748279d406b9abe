"""PySINDy: sparse regression of derivatives on a linear library, with control.

Manual: PySINDy's "Practical tips". Noisy measurements are smoothed before they are differenced
(``SmoothedFiniteDifference``), the sparsity threshold lies below the smallest coefficient that is
meant to stay, columns are normalised where scales differ, and what is known of the system goes
into the choice of variables. Here: angle, rate and acceleration of each axis are the states, so
that each axis can have its rotor's lag, and both voltages are controls.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from tests.bench.peers.interface import Meter, read_task, write_linear

WINDOW_S = 0.2
THRESHOLD = 0.01
EDGE_S = 1.0


def main(task_file: str, found_file: str) -> None:
    import pysindy as ps

    task = read_task(Path(task_file))
    window = 2 * round(WINDOW_S / task.dt / 2) + 1
    meter = Meter()
    with meter.fitting():
        difference = ps.SmoothedFiniteDifference(smoother_kws={"window_length": window})
        rate = np.asarray(difference._differentiate(task.angle, task.t))
        angle = np.asarray(difference.smoothed_x_)
        acceleration = np.asarray(difference._differentiate(rate, task.t))
        rate = np.asarray(difference.smoothed_x_)
        inside = slice(round(EDGE_S / task.dt), -round(EDGE_S / task.dt))
        X = np.hstack([angle, rate, acceleration])[inside]
        u0 = task.voltage[inside].mean(axis=0)
        model = ps.SINDy(
            optimizer=ps.STLSQ(threshold=THRESHOLD, alpha=1e-6, normalize_columns=True),
            feature_library=ps.PolynomialLibrary(degree=1, include_bias=True),
            differentiation_method=difference,
        )
        model.fit(X, t=task.dt, u=task.voltage[inside] - u0)
    found = np.asarray(model.coefficients())  # columns: 1, nine states, two controls
    write_linear(
        Path(found_file), meter,
        f"STLSQ threshold {THRESHOLD:g}, Savitzky–Golay over {WINDOW_S:g} s, 9 states",
        A=found[:, 1:10], B=found[:, 10:], C=np.eye(3, 9), c=found[:, 0] - found[:, 10:] @ u0,
    )  # fmt: skip


if __name__ == "__main__":
    main(*sys.argv[1:])
