"""Adapter of AeroID: output error and filter error on the rigid body of `rigid`, ten parameters.

Settings, by AeroID's README and the docstrings of ``identify`` and ``filter_states``:

- ``output_error``: weights are "inverse measurement noise standard deviations": the encoders'.
  It starts at the *true* parameters. From the start values of the other tools it converged to
  another minimum, with half of the parameters off by more than 100 %; the benchmark would then
  measure the search and not the criterion.
- ``filter_error``: process noise as continuous power spectral density, measurement noise as
  variance. It needs both and gets the *true* values, which no user knows. Its ``sigma2``,
  near 1 if they are right, is part of the reported setting.
- Both: AeroID interpolates controls linearly between samples, so it gets the mean voltage *around*
  each sample. The samples are 20 ms apart: at 2 ms both methods would take ten times as long.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tests.bench.peers import rigid
from tests.bench.peers.interface import Meter, Task, read_task, write_physical
from tests.bench.peers.sampling import node_means

INTERVAL_S = 0.02
OUTPUTS = ("roll", "pitch", "yaw")


def main(method: str, task_file: str, found_file: str) -> None:
    import aeroid

    task = read_task(Path(task_file))
    factor = round(INTERVAL_S / task.dt)
    u, y = node_means(task.voltage, task.angle, factor)
    known = tuple(map(float, task.known))

    def dynamics(
        t: float, x: np.ndarray, u: np.ndarray, p: Mapping[str, float]
    ) -> tuple[float, ...]:
        return rigid.derivative(*x.tolist(), *u.tolist(), (*[p[n] for n in rigid.NAMES], *known))

    model = aeroid.Model(
        states=rigid.STATES,
        controls=("v_front", "v_back"),
        parameters=dict(zip(rigid.NAMES, map(float, task.nominal), strict=True)),
        dynamics=dynamics,
        outputs=OUTPUTS,
        measurement=lambda t, x, u, p: x[:3],
    )
    columns = {**dict(zip(OUTPUTS, y.T, strict=True)), "v_front": u[:, 0], "v_back": u[:, 1]}
    data = aeroid.FlightData(time=np.arange(len(u)) * INTERVAL_S, channels=columns)
    x0 = np.zeros(8)
    x0[:3] = y[0]
    bounds = {n: (1e-4 * v, 20 * v) for n, v in model.parameters.items()}
    meter = Meter()
    with meter.fitting():
        result = aeroid.identify(
            model, data, rigid.NAMES, method=method, x0=x0, bounds=bounds, **noise(method, task)
        )
    write_physical(
        Path(found_file), meter,
        f"identify(method={method!r}), every {INTERVAL_S * 1e3:g} ms, {result.n_evaluations} "
        f"evaluations, sigma2 {result.sigma2:.3g}",
        np.array([result.parameters[n] for n in rigid.NAMES]),
        np.array([result.stderr[n] for n in rigid.NAMES]),
    )  # fmt: skip


def noise(method: str, task: Task) -> dict[str, object]:
    """Returns the noise arguments of ``identify`` for this method."""
    encoder = task.rad_per_count**2 / 12  # variance of rounding to a count
    if method == "output_error":
        return {"weights": dict(zip(OUTPUTS, encoder**-0.5, strict=True))}
    psd = np.zeros(8)
    psd[3:6] = task.acceleration_noise**2
    P0 = np.diag([*encoder, *[1e-6] * 5])
    return {
        "process_noise": dict(zip(rigid.STATES, psd, strict=True)),
        "measurement_noise": dict(zip(OUTPUTS, encoder, strict=True)),
        "filter_options": {"P0": P0},
    }


if __name__ == "__main__":
    main(*sys.argv[1:])
