"""Adapter of ``n4sid`` in Octave's control package, a black box. Needs ``octave-control``.

Settings, as ``help n4sid`` recommends: the order N if known (here the rig's eight states), S (block
rows) at its default for that N (16), 'alg' at its default 'C' (Cholesky). INFO.K and INFO.Ry give
the predictor. Means are subtracted first.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from tests.bench.peers.interface import Meter, peak_MB, read_task, write_linear
from tests.bench.peers.sampling import held_means

INTERVAL_S = 0.04
ORDER = 8
SCRIPT = """
pkg load control
load('task.mat');
dat = iddata(y, u, T);
start = cputime;
[sys, x0, info] = n4sid(dat, order);
cpu_s = cputime - start;
[A, B, C, D] = ssdata(sys);
K = info.K; S = info.Ry;
status = '';
if (exist('/proc/self/status', 'file'))
  status = fileread('/proc/self/status');
end
save('-v7', 'found.mat', 'A', 'B', 'C', 'D', 'K', 'S', 'cpu_s', 'status');
"""


def main(task_file: str, found_file: str) -> None:
    from scipy.io import loadmat, savemat

    task = read_task(Path(task_file))
    factor = round(INTERVAL_S / task.dt)
    u, y = held_means(task.voltage, task.angle, factor)
    u0, y0 = u.mean(axis=0), y.mean(axis=0)
    with tempfile.TemporaryDirectory() as folder:
        savemat(f"{folder}/task.mat", {"u": u - u0, "y": y - y0, "T": INTERVAL_S, "order": ORDER})
        subprocess.run(
            ["octave", "--no-gui", "--norc", "--quiet", "--eval", SCRIPT],
            cwd=folder, check=True, capture_output=True,
        )  # fmt: skip
        got = loadmat(f"{folder}/found.mat")
    meter = Meter(float(got["cpu_s"].item()), peak_MB(str(got["status"].item())))
    write_linear(
        Path(found_file), meter, f"n4sid(dat, {ORDER}), every {INTERVAL_S * 1e3:g} ms",
        interval_s=INTERVAL_S, u0=u0, y0=y0, **{name: got[name] for name in "ABCDKS"},
    )  # fmt: skip


if __name__ == "__main__":
    main(*sys.argv[1:])
