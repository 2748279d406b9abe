"""A profile is read exactly; an error names the wrong key, the file and the nearest key."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from heli3dof.errors import ProfileError
from heli3dof.rig.profile import TABLE_I, default_profile, load_profile, profile_from_dict
from heli3dof.rig.profile_file import merged
from tests.paths import REAL_DATA, needs_real_data

GOOD = """
[geometry]
L_w = 0.4699
L_a = 0.6604
L_h = 0.1778
[mass]
m_w = 1.87
m_f = 0.575
m_b = 0.575
[motor]
K_f = 0.1188
V_o = 7.456
v_max = 24
[encoder]
roll = -4096
pitch = 4096
yaw = 8192
[loop]
rate_hz = 500
"""


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "rig.toml"
    path.write_text(text)
    return path


def test_the_built_in_profile_is_table_i(tmp_path: Path) -> None:
    profile = load_profile(write(tmp_path, GOOD.replace("-4096", "4096")))
    assert profile.geometry == default_profile().geometry
    assert profile.mass == default_profile().mass
    assert profile.motor == default_profile().motor


def test_an_encoder_that_counts_down_has_a_negative_step(tmp_path: Path) -> None:
    profile = load_profile(write(tmp_path, GOOD))
    assert profile.encoder.rad_per_count[0] == pytest.approx(-2 * 3.141592653589793 / 4096)


def test_without_a_controller_section_the_controller_is_unknown(tmp_path: Path) -> None:
    assert not load_profile(write(tmp_path, GOOD)).controller_is_known


def test_an_empty_controller_section_is_the_default_controller(tmp_path: Path) -> None:
    profile = load_profile(write(tmp_path, GOOD + "[controller]\n"))
    assert profile.controller_is_known
    assert profile.controller is not None
    assert profile.controller.K_g[0].tolist() == [37.6, 13.2, -11.5, 20.9, 4.7, -16.1, 10.0, -1.0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("L_w = 0.4699", "L_ww = 0.4699"), ["geometry.L_ww", "L_w"]),
        (("K_f = 0.1188\n", ""), ["motor.K_f", "missing"]),
        (("L_h = 0.1778", "L_h = -0.1778"), ["geometry.L_h", "greater than 0"]),
        (("m_w = 1.87", 'm_w = "heavy"'), ["mass.m_w", "heavy"]),
        (("m_w = 1.87", "m_w = nan"), ["mass.m_w", "finite"]),
        (("yaw = 8192", "yaw = 0"), ["encoder.yaw", "zero"]),
        (("yaw = 8192", "yaw = 8192.5"), ["encoder.yaw"]),
        (("[loop]", "[lop]"), ["'lop'", "loop"]),
        (("rate_hz = 500", "rate_hz ="), ["not valid TOML"]),
    ],
)
def test_a_wrong_key_is_named_with_its_file(tmp_path: Path, change: tuple, words: list) -> None:
    path = write(tmp_path, GOOD.replace(*change))
    with pytest.raises(ProfileError) as caught:
        load_profile(path)
    assert caught.value.exit_code == 2
    for part in [*words, str(path)]:
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("L_a = 0.6604", "L_a = 66.04"), ["geometry.L_a = 66.04", "0.05 to 3 m", "centimetres"]),
        (("L_h = 0.1778", "L_h = 177.8"), ["geometry.L_h", "millimetres"]),
        (("m_w = 1.87", "m_w = 1870"), ["mass.m_w", "grams"]),
        (("rate_hz = 500", "rate_hz = 0.5"), ["loop.rate_hz", "kilohertz"]),
        (
            ("[loop]", "[limits]\nlate_max_share = 50\n[loop]"),
            ["limits.late_max_share = 50", "0 to 1"],
        ),
        (
            ("[loop]", "[limits]\nroll_min_deg = 40\n[loop]"),
            ["limits.roll_min_deg = 40° is not below limits.roll_max_deg = 34°"],
        ),
        (("V_o = 7.456", "V_o = 24"), ["V_o = 24 V is not below motor.v_max = 24 V"]),
    ],
)
def test_an_implausible_number_is_refused_with_the_likely_unit(
    tmp_path: Path, change: tuple, words: list
) -> None:
    with pytest.raises(ProfileError) as caught:
        load_profile(write(tmp_path, GOOD.replace(*change)))
    for part in words:
        assert part in str(caught.value)


def test_a_recorded_profile_may_have_an_implausible_number() -> None:
    data = {**TABLE_I, "geometry": {"L_w": 0.4699, "L_a": 66.04, "L_h": 0.1778}}
    assert profile_from_dict(data, recorded=True).geometry.L_a == 66.04


def test_all_wrong_keys_are_reported_at_once(tmp_path: Path) -> None:
    text = GOOD.replace("m_f = 0.575\n", "").replace("[loop]\nrate_hz = 500\n", "")
    with pytest.raises(ProfileError) as caught:
        load_profile(write(tmp_path, text.replace("L_a =", "L_aa =").replace("1.87", "-1.87")))
    for part in ("'geometry.L_aa'", "'mass.m_f', 'loop.rate_hz' are missing", "mass.m_w = -1.87"):
        assert part in str(caught.value)
    assert "'geometry.L_a'" not in str(caught.value), "misspelt is not missing as well"


def test_inertias_follow_from_the_masses_unless_given() -> None:
    assert default_profile().inertias == default_profile().mass_inertias
    measured = profile_from_dict({**TABLE_I, "inertia": {"yaw": 1.2}})
    assert measured.inertias == (*default_profile().inertias[:2], 1.2)
    assert profile_from_dict(measured.to_dict()) == measured


@pytest.mark.parametrize(
    ("gain", "what", "cause"),
    [
        ([[1.0] * 3] * 2, "controller.K is 2 × 3; it must be 2 × 8", "another controller"),
        ([[1.0] * 2] * 8, "controller.K is 8 × 2; it must be 2 × 8", "exchanged"),
        ([[1.0] * 8, [1.0] * 7], "controller.K is rows of 8, 7", "numbers are missing"),
        ([1.0] * 16, "controller.K is no matrix", "another controller"),
    ],
)
def test_a_gain_of_the_wrong_shape_is_refused_with_its_shape(
    gain: list, what: str, cause: str
) -> None:
    with pytest.raises(ProfileError) as caught:
        profile_from_dict({**TABLE_I, "controller": {"K": gain}})
    assert what in caught.value.what
    assert cause in caught.value.cause


def test_a_decimal_comma_is_named_with_its_line(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD.replace("L_a = 0.6604", "L_a = 0,6604"))
    with pytest.raises(ProfileError) as caught:
        load_profile(path)
    assert "decimal comma in 'L_a = 0,6604'" in caught.value.cause
    assert "write 0.6604 in line 4" in caught.value.fix


def test_a_profile_that_does_not_exist_is_named(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match="no profile"):
        load_profile(tmp_path / "none.toml")


def test_a_profile_is_read_back_from_its_dict() -> None:
    profile = profile_from_dict(TABLE_I)
    assert profile_from_dict(profile.to_dict()) == profile


@needs_real_data
@pytest.mark.parametrize("rig", ["rig-a", "rig-b"])
def test_the_real_profiles_load(rig: str) -> None:
    profile = load_profile(REAL_DATA / rig / "profile.toml")
    assert profile.name == rig
    assert not profile.controller_is_known


def test_with_gain_changes_only_the_gain() -> None:
    profile = default_profile()
    K = 2 * profile.with_controller().controller.K_g
    changed = profile.with_gain(K)
    np.testing.assert_array_equal(changed.controller.K_g, K)
    rest = {"controller": {"K": profile.to_dict()["controller"]["K"]}}
    assert merged(changed.to_dict(), rest) == profile.to_dict()
    unknown = profile.model_copy(update={"controller": None})
    assert unknown.with_gain(profile.controller.K_g) == profile


@pytest.mark.parametrize("K", [np.ones(8), np.ones((8, 2)), np.full((2, 8), np.nan)])
def test_a_gain_of_the_wrong_shape_or_not_finite_is_an_error(K: np.ndarray) -> None:
    with pytest.raises(ProfileError, match="2 × 8"):
        default_profile().with_gain(K)


def test_the_repr_has_at_most_three_lines() -> None:
    text = repr(default_profile())
    assert "table-1" in text
    assert len(text.splitlines()) <= 3


def test_a_value_where_a_table_belongs_is_named_as_such() -> None:
    with pytest.raises(ProfileError, match=r"the content = \[1\] is not a table of keys"):
        profile_from_dict([1])  # type: ignore[arg-type]
    with pytest.raises(ProfileError, match=r"motor = 3 is not a table of keys"):
        profile_from_dict({**TABLE_I, "motor": 3})


def test_a_dict_that_lacks_a_key_is_called_incomplete() -> None:
    with pytest.raises(ProfileError, match=r"'loop\.rate_hz' is missing") as caught:
        profile_from_dict({k: v for k, v in TABLE_I.items() if k != "loop"})
    assert "cut short" not in caught.value.cause
