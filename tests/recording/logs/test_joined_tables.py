"""Several logs of one flight: common clocks, and the errors where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.errors import RecordingError
from heli3dof.recording.logs.importer import Table
from heli3dof.recording.logs.joined_tables import join, with_clock

T = np.arange(100) / 500


def table(source: str, **columns: np.ndarray) -> Table:
    return Table(source, columns, lambda k: f"sample {k + 1}")


def test_logs_with_the_same_clock_are_joined_row_by_row() -> None:
    joined = join([table("a.mat", t_s=T, u=T), table("b.mat", t_s=T, x=2 * T)])
    assert list(joined.columns) == ["t_s", "u", "x"]
    np.testing.assert_array_equal(joined.columns["x"], 2 * T)
    assert joined.warnings == []


def test_only_common_instants_are_kept_with_a_warning() -> None:
    joined = join([table("a.mat", t_s=T, u=T), table("b.mat", t_s=T[20:] + 1e-5, x=T[20:])])
    np.testing.assert_array_equal(joined.columns["t_s"], T[20:])
    np.testing.assert_array_equal(joined.columns["u"], joined.columns["x"])
    assert "u in a.mat: 20 of 100 samples were left out" in joined.warnings[0]


def test_of_rates_that_are_multiples_the_common_instants_are_kept() -> None:
    for several in ((table("a", t_s=T, u=T), table("a", t_s=T[::5], x=T[::5])),
                    (table("a", t_s=T[::5], u=T[::5]), table("a", t_s=T, x=T))):  # fmt: skip
        joined = join(several)
        np.testing.assert_array_equal(joined.columns["t_s"], T[::5])
        np.testing.assert_array_equal(joined.columns["u"], joined.columns["x"])
        (warning,) = joined.warnings
        assert "80 of 100 samples were left out" in warning


def test_equal_names_get_their_files_name() -> None:
    joined = join([table("a.mat", t_s=T, u=T), table("b.mat", t_s=T, u=T)])
    assert list(joined.columns) == ["t_s", "a.u", "b.u"]
    with pytest.raises(RecordingError, match=r"Two signals are named a\.u"):
        join([table("a.mat", t_s=T, u=T), table("a.mat", t_s=T, u=T)])


def test_a_log_without_clock_needs_the_same_length() -> None:
    joined = join([table("b.mat", x=T), table("a.csv", time=T, u=T)])
    np.testing.assert_array_equal(joined.columns["t_s"], T)
    with pytest.raises(RecordingError, match=r"x in b\.mat: 50 samples"):
        join([table("a.csv", time=T, u=T), table("b.mat", x=T[:50])])


@pytest.mark.parametrize(
    ("other", "what"),
    [
        (T + 10, "do not overlap: u in a.mat 0 … 0.198 s, x in b.mat 10 …"),
        (T + 0.001, "sampled at different instants"),
        (1.5 * T, "x in b.mat and u in a.mat are sampled at different rates: every 0.003 and"),
        (1000 * T, "different rates"),
        (T[::-1], "b.mat: time does not increase"),
    ],
)
def test_clocks_that_differ_are_refused(other: np.ndarray, what: str) -> None:
    with pytest.raises(RecordingError, match=what) as caught:
        join([table("a.mat", t_s=T, u=T), table("b.mat", t_s=other, x=T)])
    assert caught.value.fix


@pytest.mark.parametrize("name", ["time", "Time", "t", "tout"])
def test_a_clock_is_recognised_by_its_name(name: str) -> None:
    found = with_clock(Table("a.csv", {"u": T, name: T}, str))
    np.testing.assert_array_equal(found.columns["t_s"], T)
    assert found.origins == {"t_s": name}
