"""For the grey box, a long gap ends a run; late and lost samples do not."""

from __future__ import annotations

import numpy as np

from heli3dof.identification.greybox.usable_runs import usable_runs
from heli3dof.model.estimation.filter_data import data_of
from tests.identification.test_preprocessing import flying


def test_late_samples_end_no_run() -> None:
    n = 5000
    late = np.random.default_rng(3).uniform(0.0, 0.9, n)
    (run,) = usable_runs(flying(n, t=0.002 * (np.arange(n) + late)), 0)
    assert (run.start, run.stop) == (0, n)


def test_the_voltage_is_held_across_a_lost_sample() -> None:
    t = 0.002 * np.delete(np.arange(5001), np.arange(50, 5000, 100))
    rec = flying(len(t), t=t)
    data = data_of([rec], usable_runs(rec, 0))
    assert len(data.blocks) == 1
    assert int((data.h > 0.0039).sum()) == 50


def test_ten_lost_in_a_row_end_a_run() -> None:
    t = 0.002 * np.delete(np.arange(4010), np.arange(2000, 2010))
    assert [(r.start, r.stop) for r in usable_runs(flying(4000, t=t), 0)] == [
        (0, 2000),
        (2000, 4000),
    ]
