"""Several logs of one flight: common clocks, and the errors where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.errors import RecordingError
from heli3dof.recording.logs.importer import Table
from heli3dof.recording.logs.joined_tables import join, join_used, with_clock

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


@pytest.mark.parametrize("other", [T[:40], T[::5], T + 0.001, 1.5 * T, T + 10])
def test_a_table_that_no_mapping_needs_costs_no_samples(other: np.ndarray) -> None:
    run1, run2 = table("i.mat", t_s=T, run1=T), table("i.mat", t_s=other, run2=other)
    joined = join_used([run1, run2], ["2*run1", "pi"])
    np.testing.assert_array_equal(joined.columns["run1"], T)
    assert list(joined.columns) == ["t_s", "run1"]
    assert joined.ignored == ["run2 in i.mat: not mapped, and not sampled at all times"]
    assert joined.warnings == []


def test_unmapped_tables_that_cost_no_samples_are_kept() -> None:
    tables = [table("i.mat", t_s=T, temperature=T), table("i.mat", t_s=T, u=T)]
    assert list(join_used(tables, ["u"]).columns) == ["t_s", "temperature", "u"]
    own = [table("i.mat", t_s=T, roll_deg=T), table("i.mat", t_s=T[:50], u=T[:50])]
    assert len(join_used(own, ["u"])) == 50
    assert len(join_used(own, [])) == 100


def test_a_warning_names_the_signals_that_lack_samples() -> None:
    joined = join([table("i.mat", t_s=T, u=T), table("i.mat", t_s=T[:40], x=T[:40])])
    assert joined.warnings == [
        "u in i.mat: 60 of 100 samples were left out, for lack of samples of x in i.mat at these "
        "times. If these signals are of different flights, use those of one only."
    ]


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
