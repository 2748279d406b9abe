from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.axes import YAW
from heli3dof.identification.row_selection import clipped, unusable, usable_runs
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.rig.profile import default_profile
from tests.identification.test_preprocessing import flying

DT = 0.002


def flight(
    roll_deg: np.ndarray, volts: np.ndarray | float = 7.0, pitch_deg: float = 0.0
) -> Recording:
    n = len(roll_deg)
    t = np.arange(n) * DT
    angle = np.deg2rad(np.column_stack([roll_deg, pitch_deg + np.sin(t), np.cos(t)]))
    voltage = np.broadcast_to(np.reshape(volts, (-1, 1)), (n, 2)).copy()
    return recording_of_arrays(t, voltage, angle, default_profile())


def from_the_table() -> np.ndarray:
    """1 s on the table, 1 s of climb, 8 s of level flight."""
    level = 0.5 * np.sin(np.arange(4000) * DT)
    return np.concatenate([np.full(500, -27.5), np.linspace(-27.5, 0, 500), level])


def test_rest_and_take_off_are_excluded_and_level_flight_is_kept() -> None:
    rows = unusable(flight(from_the_table()))
    assert rows["table"][:500].all()
    assert not rows["table"][520:].any()
    # lift-off is 1° above the table, 18 samples into the climb; three seconds later it is over
    bad = rows["table"] | rows["take_off"]
    assert bad[:2010].all()
    assert not bad[2030:].any()


def test_take_off_lasts_while_the_amplifier_is_at_its_limit() -> None:
    roll = from_the_table()
    volts = np.where(np.arange(len(roll)) < 3000, 24.0, 7.0)
    rec = flight(roll, volts)
    rows = unusable(rec)
    assert rows["take_off"][2900]
    assert not rows["take_off"][3000 + 130]
    assert clipped(rec).sum() == 3000


def test_a_flight_that_starts_level_keeps_all_rows() -> None:
    rows = unusable(flight(10 * np.sin(np.arange(5000) * DT)))
    assert not any(m.any() for m in rows.values())


def test_motors_off_lasts_until_the_arm_rises_again() -> None:
    roll = np.concatenate([np.zeros(1000), np.linspace(0, -10, 500), np.linspace(-10, 0, 1000)])
    volts = np.full(2500, 7.0)
    volts[1000:1300] = 0.0
    rows = unusable(flight(roll, volts))
    assert rows["motors_off"][1000:1490].all()
    assert not rows["motors_off"][:1000].any()
    assert not rows["motors_off"][1510:].any()


def test_a_single_zero_volt_sample_is_no_motor_cut() -> None:
    volts = np.full(2500, 7.0)
    volts[1000] = 0.0
    assert not unusable(flight(np.sin(np.arange(2500) * DT), volts))["motors_off"].any()


def test_the_fall_at_the_end_is_excluded() -> None:
    roll = np.concatenate([from_the_table(), np.linspace(0, -27, 400)])
    rows = unusable(flight(roll))
    assert rows["falling"][-150:].all()
    assert not rows["falling"][:4900].any()


def test_rest_at_a_stop_is_excluded_and_a_turning_point_is_not() -> None:
    n = 5000
    roll = 20 + 16 * np.sin(np.arange(n) * DT * 2)
    roll[2000:2400] = 36.0
    rows = unusable(flight(np.round(roll * 4096 / 360) * 360 / 4096))
    assert rows["stop"][2010:2390].all()
    assert rows["stop"].sum() < 450


def test_an_impact_on_a_stop_is_excluded_even_if_short() -> None:
    """Roll at 60°/s, held at 32° for 50 ms: v T = 3°, where a turning point gives 4 counts."""
    n = 5000
    turning = 28 * np.sin(np.arange(n) * DT * 2)
    blow = turning.copy()
    at = 2000
    blow[at - 100 : at] = np.linspace(20, 32, 100, endpoint=False)
    blow[at : at + 25] = 32.0
    blow[at + 25 : at + 100] = np.linspace(32, 20, 75)
    grid = 360 / 4096
    rows = unusable(flight(np.round(blow / grid) * grid))
    assert rows["stop"][at : at + 25].all()
    assert rows["stop"].sum() < 35
    assert not unusable(flight(np.round(turning / grid) * grid))["stop"].any()


def test_a_soft_touch_of_a_known_stop_is_excluded() -> None:
    """15°/s and 20 ms on the count where later it rests for 0.5 s: v T = 0.3°, 3.4 counts, which
    alone is a turning point."""
    n, at, grid = 5000, 2000, 360 / 4096
    touch = 28 * np.sin(np.arange(n) * DT * 2)
    touch[at - 150 : at] = 32 - 15 * DT * np.arange(150, 0, -1)
    touch[at : at + 10] = 32.0
    touch[at + 10 : at + 200] = 32 - 15 * DT * np.arange(190)
    alone = np.round(touch / grid) * grid
    assert not unusable(flight(alone))["stop"].any()
    rests = alone.copy()
    rests[4000:4250] = alone.max()
    rows = unusable(flight(rests))["stop"]
    assert rows[at : at + 10].all()
    assert rows[4001:4250].all()
    assert rows.sum() < 280


def test_yaw_has_no_stop() -> None:
    """Dry friction holds yaw on one count at 90° while roll and pitch move."""
    level = flight(np.full(3000, 5.0))
    angle = level.angle.copy()
    angle[:, YAW] = np.deg2rad(np.minimum(90.0, np.linspace(0.0, 180.0, len(angle))))
    rows = unusable(replace(level, angle=angle))
    assert not rows["stop"].any()


def test_the_ramp_down_is_excluded() -> None:
    rec = flight(np.sin(np.arange(3000) * DT))
    rec.channels["phase"] = np.where(np.arange(3000) < 2500, 0.0, 1.0)  # type: ignore[index]
    rows = unusable(rec)
    assert rows["ramp_down"].sum() == 500


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
