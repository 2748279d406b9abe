"""Mappings of another program's columns: what expressions may contain, and the errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.errors import RecordingError, UsageError
from heli3dof.recording.logs.column_mapping import mapped, parse_mapping
from heli3dof.recording.logs.importer import Table

N = 12
T = np.arange(N) / 500
TABLE = Table(
    "log.csv",
    {
        "t_s": T,
        "Vs": np.full(N, 15.0),
        "Vd": np.arange(N) * 1.0,
        "Vf (V)": np.full(N, 4.0),
        "x[1]": np.arange(N) * 0.1,
        "x[11]": np.full(N, 7.0),
        "v_front_V": np.full(N, 1.0),
        "v_back_V": np.full(N, 2.0),
    },
    str,
)


def column(expression: str, name: str = "roll_rad") -> np.ndarray:
    return mapped(TABLE, {name: expression}, {}).columns[name]


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("(Vs-Vd)/2", (15 - np.arange(N)) / 2),
        ("57.2958*x[1]", 5.72958 * np.arange(N)),
        ("x[11] - x[1]", 7 - 0.1 * np.arange(N)),
        ("-Vf (V)/2 + 1e1", np.full(N, 8.0)),
        ("clip(Vd, 2, 5)", np.clip(np.arange(N), 2, 5)),
        ("radians(Vd)**2 + sin(pi/2)", np.radians(np.arange(N)) ** 2 + 1),
        ("sample/500", T),
        ("0", np.zeros(N)),
    ],
)
def test_an_expression_computes_a_column(expression: str, expected: np.ndarray) -> None:
    np.testing.assert_allclose(column(expression), expected)


@pytest.mark.parametrize("turn", [360.0, 2 * np.pi])
def test_an_angle_in_degrees_is_unwrapped_by_360(turn: float) -> None:
    """A turn and a half in steps of an eighth, wrapped to ± half a turn."""
    angle = turn * np.arange(N) / 8
    wrapped = np.mod(angle + turn / 2, turn) - turn / 2
    table = replace(TABLE, columns={**TABLE.columns, "x[1]": wrapped})
    found = mapped(table, {"yaw_rad": "unwrap(x[1])"}, {}).columns["yaw_rad"]
    np.testing.assert_allclose(found, angle)


def test_a_name_is_the_logs_column_or_else_another_mapped_one() -> None:
    swapped = mapped(TABLE, {"v_front_V": "v_back_V", "v_back_V": "v_front_V"}, {}).columns
    assert (swapped["v_front_V"][0], swapped["v_back_V"][0]) == (2, 1)
    limited = mapped(TABLE, {"v_front_V": "clip(v_front_cmd_V,-5,5)", "v_front_cmd_V": "Vs"}, {})
    assert limited.columns["v_front_V"][0] == 5


def test_used_columns_are_dropped_and_the_others_kept_as_channels() -> None:
    result = mapped(TABLE, {"roll_deg": "x[1]"}, {})
    assert "x[1]" not in result.columns
    assert {"Vs", "Vd", "x[11]"} <= result.columns.keys()
    assert result.origins == {"roll_deg": "x[1]"}


def test_a_mapped_angle_replaces_the_logs_own_in_the_other_unit() -> None:
    log = replace(TABLE, columns={**TABLE.columns, "roll_rad": T})
    result = mapped(log, {"roll_deg": "x[1]"}, {})
    assert "roll_rad" not in result.columns
    assert result.ignored == ["roll_rad of the log: replaced by the mapping"]


def test_the_command_line_replaces_the_profiles_expression_in_either_unit() -> None:
    result = mapped(TABLE, {"roll_deg": "1"}, {"roll_rad": "x[1]", "yaw_rad": "x[11]"})
    assert "roll_rad" not in result.columns
    assert result.columns["yaw_rad"][0] == 7


def test_the_profile_does_not_replace_a_column_of_ours_that_a_log_has() -> None:
    result = mapped(TABLE, {}, {"v_front_V": "raw[1]/2"})
    np.testing.assert_array_equal(result.columns["v_front_V"], TABLE.columns["v_front_V"])
    assert result.ignored == [
        "[log] v_front_V of the profile: the log has its own column v_front_V"
    ]
    with pytest.raises(RecordingError, match=r"\[log\] roll_deg=raw\[1\] of the profile"):
        mapped(TABLE, {}, {"roll_deg": "raw[1]"})


@pytest.mark.parametrize(
    ("expression", "what"),
    [
        ("x[7]", r"names 'x\[7\]'"),
        ("Vz", "names 'Vz'"),
        ("(Vs", "is not an expression"),
        ("Vs;Vd", "is not an expression"),
        ("Vs > 1", "Compare is not available"),
        ("sin(Vs, Vd)", "sin takes 1 value"),
        ("roll_rad + 1", "refers to itself"),
        ("'a' * 3", "cannot be computed"),
    ],
)
def test_a_faulty_expression_is_refused_with_its_text(expression: str, what: str) -> None:
    with pytest.raises(UsageError, match=what) as caught:
        column(expression)
    assert expression in caught.value.what
    assert caught.value.fix


@pytest.mark.parametrize(
    "attack",
    [
        "__import__('os').system('touch pwned')",
        "open('/etc/passwd')",
        "Vs.__class__.__mro__",
        "Vs.tofile('pwned')",
        "(lambda: 1)()",
        "[x for x in (1, 2)]",
        "sin.__globals__",
        "f'{Vs}'",
        "clip(Vs, 0, 1, out=Vd)",
    ],
)
def test_an_expression_cannot_run_code(attack: str) -> None:
    before = {name: values.copy() for name, values in TABLE.columns.items()}
    with pytest.raises(UsageError):
        column(attack)
    for name, values in before.items():
        np.testing.assert_array_equal(TABLE.columns[name], values)


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["v_front_V"], "is not COLUMN=EXPRESSION"),
        (["v_front_V="], "is not COLUMN=EXPRESSION"),
        (["v_frnt_V=Vs"], "no column v_frnt_V"),
        (["roll_deg=1", "roll_deg=2"], "names roll_deg twice"),
    ],
)
def test_a_faulty_option_is_refused(words: list[str], what: str) -> None:
    with pytest.raises(UsageError, match=what):
        parse_mapping(words)


def test_a_misspelt_column_gives_the_nearest_one() -> None:
    with pytest.raises(UsageError) as caught:
        parse_mapping(["v_frnt_V=Vs"])
    assert "did you mean 'v_front_V'?" in caught.value.cause
