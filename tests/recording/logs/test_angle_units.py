"""Angles in another unit than their name says."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heli3dof.axes import AXES
from heli3dof.errors import RecordingError
from heli3dof.recording.logs.angle_units import check_angles, newton, on_grid
from heli3dof.recording.logs.importers.csv_file import read as read_csv
from heli3dof.rig.profile import load_profile
from tests.paths import REAL_DATA, needs_real_data
from tests.recording.make import flight, log_columns, open_profile

PROFILE = open_profile()


def columns(quantised: bool = True, seed: int = 1) -> dict[str, np.ndarray]:
    data = log_columns(flight(3000, seed=seed, quantised=quantised))
    return {name: v for name, v in data.items() if "_ref_" not in name}


def as_named(data: dict[str, np.ndarray], axis: str, unit: str) -> dict[str, np.ndarray]:
    """The same values, called otherwise."""
    return {f"{axis}_{unit}" if n.startswith(axis + "_") else n: v for n, v in data.items()}


@pytest.mark.parametrize("axis", AXES)
def test_radians_under_deg_are_caught_by_the_encoders_grid(axis: str) -> None:
    data = columns()
    data[f"{axis}_deg"] = np.deg2rad(data[f"{axis}_deg"])
    with pytest.raises(RecordingError, match=f"{axis}_deg does not look like degrees") as caught:
        check_angles("log.csv", data, PROFILE)
    assert f"{axis}_rad" in caught.value.fix


@pytest.mark.parametrize("axis", AXES)
def test_degrees_under_rad_are_caught_by_the_encoders_grid(axis: str) -> None:
    with pytest.raises(RecordingError, match=f"{axis}_rad does not look like radians"):
        check_angles("log.csv", as_named(columns(), axis, "rad"), PROFILE)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.sampled_from(["roll", "pitch"]))
def test_without_a_grid_newton_separates_radians_from_degrees(seed: int, axis: str) -> None:
    data = columns(quantised=False, seed=seed)
    warnings = check_angles("log.csv", data, PROFILE)
    assert any("does not lie on the encoder's grid" in w for w in warnings)
    data[f"{axis}_deg"] = np.deg2rad(data[f"{axis}_deg"])
    with pytest.raises(RecordingError, match="times what the voltages explain"):
        check_angles("log.csv", data, PROFILE)


def test_newtons_ratio_is_one_for_a_rigid_body_driven_by_its_voltages() -> None:
    # q = a t²/2 under a step of a at t = 1 s; a = L_h K_f (V_f − V_b) / (2 m L_h²)
    t = np.arange(0, 4, 0.002)
    V_f = np.where(t >= 1, 2.0, 0.0)
    a = 0.1188 * 2.0 / (1.15 * 0.1778)
    q = np.where(t >= 1, a * (t - 1) ** 2 / 2, 0.0)
    data = {"t_s": t, "v_front_V": V_f, "v_back_V": np.zeros_like(t)}
    assert newton("pitch", q, data, PROFILE) == pytest.approx((1, 1), abs=0.01)


@pytest.mark.parametrize("unit", ["deg", "rad"])
def test_a_wrapped_angle_gets_a_warning_with_its_correction(unit: str) -> None:
    turn, data = {"deg": 360.0, "rad": 2 * np.pi}[unit], as_named(columns(), "yaw", unit)
    ramp = data["yaw_deg" if unit == "deg" else "yaw_rad"] * (turn / 360)
    ramp = ramp + np.arange(3000) // 4 * turn / 8192 * 8
    name = f"yaw_{unit}"
    whole = check_angles("log.csv", data | {name: ramp}, PROFILE)
    wrapped = data | {name: (ramp + turn / 2) % turn - turn / 2}
    warnings = check_angles("log.csv", wrapped, PROFILE, {name: "-enc"})
    assert not any("whole turn" in w for w in whole)
    assert [w for w in warnings if "whole turn" in w] == [
        f"{name} jumps by a whole turn within one sample, once. Likely cause: the angle is "
        f"wrapped. Try: import the log with --map '{name}=unwrap(-enc)'"
    ]


@pytest.mark.parametrize("factor", [1, 20])
def test_raw_counts_are_recognised(factor: int) -> None:
    data = columns()
    data["roll_deg"] = factor * np.rint(data["roll_deg"] * 4096 / 360)
    with pytest.raises(RecordingError, match="whole numbers up to") as caught:
        check_angles("log.csv", data, PROFILE, {"roll_deg": "enc[1]"})
    assert "encoder counts" in caught.value.cause
    assert "--map 'roll_deg=0.0878906*enc[1]'" in caught.value.fix


def test_an_angle_beyond_half_a_turn_is_refused() -> None:
    data = columns()
    data["pitch_deg"] = 40 * data["pitch_deg"] + 0.0123 * np.arange(3000)
    with pytest.raises(RecordingError, match="more than the axis can turn"):
        check_angles("log.csv", data, PROFILE)


def test_another_encoder_gives_a_warning() -> None:
    data = columns(quantised=False)
    data["roll_deg"] = np.rint(data["roll_deg"] / 0.18) * 0.18
    warnings = check_angles("log.csv", data, PROFILE)
    assert any("roll_deg lies on a grid of 2000 counts" in w for w in warnings)
    data["roll_deg"] = np.rint(data["roll_deg"] / (360 / 2048)) * (360 / 2048)
    warnings = check_angles("log.csv", data, PROFILE)
    assert any("roll_deg lies on a grid of 2048 counts" in w for w in warnings)


def test_a_reference_in_another_unit_than_its_angle_is_refused() -> None:
    data = columns()
    data["pitch_ref_deg"] = np.deg2rad(data["pitch_deg"] + 0.3)
    with pytest.raises(RecordingError, match=r"pitch_ref_deg with a slope of 57\.3"):
        check_angles("log.csv", data, PROFILE)


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.integers(-500, 500), min_size=10, max_size=200, unique=True),
    st.floats(1e-3, 1.0),
    st.floats(-100, 100),
)
def test_a_grid_is_found_wherever_it_starts_even_when_printed_short(
    counts: list[int], step: float, start: float
) -> None:
    values = start + step * np.array(counts)
    assert on_grid(values, step)
    assert on_grid(np.round(values / step, 1) * step, step)
    assert not on_grid(values, step * 1e9), "within half a step no grid is to be seen"


@needs_real_data
@pytest.mark.real_data
@pytest.mark.parametrize("rig", ["rig-a", "rig-b"])
def test_real_logs_under_a_wrong_unit_are_caught(rig: str) -> None:
    profile = load_profile(REAL_DATA / rig / "profile.toml")
    for path in sorted((REAL_DATA / rig).glob("*.csv")):
        data = {n: v for n, v in read_csv(path).columns.items() if "_ref_" not in n}
        for axis in [a for a in AXES if f"{a}_deg" in data]:
            radians = {**data, f"{axis}_deg": np.deg2rad(data[f"{axis}_deg"])}
            with pytest.raises(RecordingError, match="does not look like degrees"):
                check_angles(path.name, radians, profile)
            with pytest.raises(RecordingError, match="does not look like radians"):
                check_angles(path.name, as_named(data, axis, "rad"), profile)


@pytest.mark.parametrize("axis", ["roll", "pitch"])
def test_a_wrong_sign_gives_a_warning(axis: str) -> None:
    data = columns()
    assert check_angles("log.csv", data, PROFILE) == []
    data[f"{axis}_deg"] = -data[f"{axis}_deg"]
    warnings = check_angles("log.csv", data, PROFILE)
    assert any(f"{axis}_deg moves against its voltages (correlation −" in w for w in warnings)


@needs_real_data
@pytest.mark.real_data
def test_on_real_rigs_newtons_ratio_is_far_from_that_of_a_wrong_unit() -> None:
    ratios, correlations = [], []
    for path in sorted(REAL_DATA.glob("rig-*/*.csv")):
        data = read_csv(path).columns
        profile = load_profile(path.parent / "profile.toml")
        for axis in ("roll", "pitch"):
            if f"{axis}_deg" in data:
                result = newton(axis, np.deg2rad(data[f"{axis}_deg"]), data, profile)
                if result is not None:
                    ratios.append(result[0])
                    correlations.append(result[1])
    assert len(ratios) > 15
    assert 0.3 < min(ratios) < max(ratios) < 4, "the threshold is a factor of 7.6 either way"
    assert min(correlations) > -0.2, "the warning comes at -0.4"


@needs_real_data
@pytest.mark.real_data
@pytest.mark.parametrize("path", ["rig-a/closed-1b", "rig-b/closed-09"])
def test_front_and_back_swapped_on_a_real_log_are_noticed(path: str) -> None:
    data = dict(read_csv(REAL_DATA / f"{path}.csv").columns)
    profile = load_profile((REAL_DATA / path).parent / "profile.toml")
    data["v_front_V"], data["v_back_V"] = data["v_back_V"], data["v_front_V"]
    warnings = check_angles("log.csv", data, profile)
    assert [w for w in warnings if "front and back are swapped" in w]
