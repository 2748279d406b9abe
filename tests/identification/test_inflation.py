"""The factor κ that widens the intervals is one for white scores, whatever the number of blocks."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.identification.greybox import estimate as module
from heli3dof.identification.greybox.estimate import Estimate


def mean_inflation(
    monkeypatch: pytest.MonkeyPatch, n: int, m: int, *, prior: float = 0.0, variance: float = 1.0
) -> float:
    """Return the mean κ over 200 sets of m scores of n parameters, with the given variance.

    The information is the identity matrix. ``prior``: precision of the priors of half of them.
    """
    random = np.random.default_rng(4)
    precision = np.where(np.arange(n) < n // 2, prior, 0.0)

    def scores(*args: object) -> np.ndarray:
        s = random.normal(size=(m, n)) * np.sqrt(variance / m)
        return s - s.mean(axis=0)

    monkeypatch.setattr(module, "block_scores", scores)
    fit = SimpleNamespace(
        optimum=SimpleNamespace(information=np.eye(n)), free=[None] * n,
        problem=SimpleNamespace(data=None, prior_precision=precision),
    )  # fmt: skip
    inflation = cast(Any, Estimate.inflation).func
    return float(np.mean([inflation(fit) for _ in range(200)]))


@pytest.mark.parametrize(("n", "m"), [(12, 26), (12, 60), (4, 90)])
def test_scores_that_scatter_as_stated_leave_the_intervals_as_they_are(
    n: int, m: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # κ is at least 1, so its mean is a little more.
    assert 1.0 <= mean_inflation(monkeypatch, n, m) < 1.06


@pytest.mark.parametrize("prior", [0.0, 100.0])
def test_excess_scatter_is_found_also_if_priors_determine_some_parameters(
    prior: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = mean_inflation(monkeypatch, 8, 120, prior=prior, variance=1.5)
    assert found == pytest.approx(1.5, rel=0.03)
