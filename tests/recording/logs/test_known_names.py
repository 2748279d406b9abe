"""Names that other laboratories give to our columns."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.recording.logs.importer import Table
from heli3dof.recording.logs.known_names import as_options, suggest, with_own_names


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("time", {"t_s": "time"}),
        ("time_ms", {"t_s": "time_ms/1000"}),
        ("ms", {"t_s": "ms/1000"}),
        ("Vf", {"v_front_V": "Vf"}),
        ("Vb [V]", {"v_back_V": "Vb [V]"}),
        ("u_front", {"v_front_V": "u_front"}),
        ("elevation_deg", {"roll_deg": "elevation_deg"}),
        ("Travel (rad)", {"yaw_rad": "Travel (rad)"}),
        ("theta", {"pitch_rad": "theta"}),
        ("elevation_ref_deg", {"roll_ref_deg": "elevation_ref_deg"}),
        ("elevation_rate", {}),
        ("roll_deg", {}),
    ],
)
def test_a_common_name_is_suggested(name: str, expected: dict[str, str]) -> None:
    assert suggest({name: np.ones(20)}) == expected


def test_a_rising_column_in_seconds_or_milliseconds_is_the_time() -> None:
    t = np.arange(20.0)
    assert suggest({"Zeit [ms]": t}) == {"t_s": "Zeit [ms]/1000"}
    assert suggest({"delay [ms]": np.ones(20), "Zeit [s]": t}) == {"t_s": "Zeit [s]"}


def test_an_angle_beyond_a_turn_is_in_degrees() -> None:
    assert suggest({"travel": np.array([0.0, 20.0])}) == {"yaw_deg": "travel"}


def test_names_of_ours_with_a_unit_in_brackets_are_used_without_a_mapping() -> None:
    x = np.ones(9)
    result = with_own_names(Table("a.csv", {"Time [s]": x, "roll (°)": x, "tilt [deg]": x}, str))
    assert list(result.columns) == ["t_s", "roll_deg", "tilt [deg]"]
    assert result.origins == {"t_s": "Time [s]", "roll_deg": "roll (°)"}
    assert result.notes == ["Recognised by name and unit: Time [s], roll (°)."]


def test_two_columns_for_one_quantity_keep_their_names() -> None:
    for other in ("roll [rad]", "roll_rad", "Roll (deg)"):
        table = Table("a.csv", {"roll [deg]": np.ones(9), other: np.ones(9)}, str)
        assert with_own_names(table) is table


def test_sum_and_difference_give_both_voltages() -> None:
    assert suggest({"Vs": np.ones(9), "Vd": np.ones(9)}) == {
        "v_front_V": "(Vs+Vd)/2",
        "v_back_V": "(Vs-Vd)/2",
    }


def test_a_column_that_the_log_has_is_not_suggested() -> None:
    assert suggest({"roll_rad": np.ones(9), "elevation_deg": np.ones(9)}) == {}


def test_options_are_quoted_for_the_shell() -> None:
    assert as_options({"v_front_V": "(Vs-Vd)/2"}) == "--map 'v_front_V=(Vs-Vd)/2'"
