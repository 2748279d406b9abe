"""Encoder faults: sign, scale, unit, frozen counts, jumps; swapped motors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heli3dof.axes import AXES
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import step_plan
from heli3dof.integrity import Kind, integrity
from heli3dof.integrity.response import with_step
from heli3dof.integrity.scale import misfit
from heli3dof.integrity.view import View
from heli3dof.recording.logs.column_mapping import parse_mapping
from heli3dof.recording.logs.export import export
from heli3dof.recording.logs.import_log import import_log
from heli3dof.recording.recording import Recording
from tests.integrity.flights import (
    flight,
    names,
    only,
    scaled,
    swapped,
    turned,
    with_angle,
    with_voltage,
)

AXIS = st.integers(0, 2)


def test_the_responses_of_a_clean_flight_are_one() -> None:
    for axis, x in View(flight("large")).responses.items():
        assert x.gain == pytest.approx(1.0, abs=0.08), axis
        assert x.explained > 0.95


def test_a_mass_added_in_flight_leaves_the_responses_unchanged() -> None:
    """1.7 times the inertia responds 1/1.7 = 0.588 times as strongly, with or without the mass."""
    still = View(flight(hide="inertia.roll:1.7", rate_hz=500.0)).responses["roll"]
    hide = "inertia.roll:1.7,mass.change:0.04@28"
    added = View(flight(hide=hide, rate_hz=500.0)).responses["roll"]
    assert still.gain == pytest.approx(1 / 1.7, rel=0.03)
    assert added.gain == pytest.approx(still.gain, rel=0.03)


def test_a_trim_step_is_found_at_its_time_and_only_there() -> None:
    t = np.arange(0.125, 20.0, 0.125)
    rng = np.random.default_rng(1)
    X = np.column_stack([rng.standard_normal(len(t)), np.ones(len(t))])
    z = X @ [2.0, -1.0] + 0.1 * rng.standard_normal(len(t))
    assert with_step(X, z, X[:, 1], t) is X
    regressor = with_step(X, z + 0.5 * (t > 8.0), X[:, 1], t)[:, 2]
    assert abs(t[regressor > 0][0] - 8.0) < 0.7


def test_the_misfit_of_a_factor_two_matches_hand_computation() -> None:
    # Roll and pitch 1, yaw 2, scatter 0.2, K free with prior 0.35:
    # weights 25, 25, 25, 8.163; mean 25 log 2 / 83.163; Σ w (e − mean)².
    mean = 25 * np.log(2) / 83.1633
    expected = 25 * (2 * mean**2 + (np.log(2) - mean) ** 2) + 8.1633 * mean**2
    log_g = {"roll": 0.0, "pitch": 0.0, "yaw": float(np.log(2))}
    assert misfit(log_g, {}) == pytest.approx(expected, rel=1e-4)
    assert misfit(log_g, {"yaw": float(np.log(2))}) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("plan", ["rich", "steps", "large"])
@pytest.mark.parametrize("axis", range(3))
def test_a_reversed_encoder_is_named_with_its_axis(plan: str, axis: int) -> None:
    fault = only(turned(axis)(flight(plan)))
    assert (fault.check, fault.axis, fault.kind) == ("encoder.sign", AXES[axis], Kind.BAD_DATA)


@pytest.mark.parametrize("plan", ["rich", "steps", "large"])
def test_swapped_motors_are_not_a_reversed_encoder(plan: str) -> None:
    assert only(swapped(flight(plan))).check == "motors.swapped"


def test_a_mirrored_rig_is_detected_by_yaw_and_both_causes_are_named() -> None:
    fault = only(turned(1)(swapped(flight("rich"))))
    assert (fault.check, fault.axis) == ("encoder.sign", "yaw")
    assert "front and back are swapped too" in fault.cause


def test_with_little_yaw_motion_both_causes_are_named() -> None:
    for change in (swapped, turned(1)):
        fault = only(change(flight("run-step")))
        assert (fault.check, fault.axis) == ("encoder.sign", "pitch")
        assert "swapped" in fault.cause
        assert fault.confidence <= 0.5


def test_voltages_with_the_wrong_sign_are_detected() -> None:
    assert only(with_voltage(flight(), -1)).check == "voltage.sign"


def test_a_hover_voltage_of_the_wrong_sign_in_the_profile_is_detected() -> None:
    r = flight()
    motor = r.profile.motor.model_copy(update={"V_o": -r.profile.motor.V_o})
    fault = only(replace(r, profile=r.profile.model_copy(update={"motor": motor})))
    assert fault.check == "voltage.sign"
    assert fault.fix.startswith("set motor.V_o = 7.4")


@pytest.mark.parametrize(
    ("plan", "k"),
    [("rich", 0.25), ("rich", 4.0), ("steps", 0.5), ("steps", 2.0)],
)
@pytest.mark.parametrize("axis", range(3))
def test_counts_off_by_a_factor_are_named(plan: str, axis: int, k: float) -> None:
    faults = integrity(scaled(axis, k)(flight(plan)))
    (fault,) = (f for f in faults if f.check == "encoder.counts")
    assert (fault.effect, fault.axis) == ("encoder.scale", AXES[axis])
    assert fault.parameters["scale"][0] == pytest.approx(k, rel=0.15)


def test_half_the_counts_may_be_twice_the_inertia() -> None:
    (fault,) = (f for f in integrity(scaled(0, 0.5)(flight())) if f.check == "encoder.counts")
    assert fault.kind == Kind.NOTE
    assert "twice its inertia" in fault.cause


def test_a_coarser_encoder_with_the_right_angle_is_not_a_wrong_scale() -> None:
    r = flight()
    coarse = 2 * np.pi / 1024
    faults = names(with_angle(r, 1, np.round(r.angle[:, 1] / coarse) * coarse))
    assert faults == {"encoder.grid.pitch"}


@pytest.mark.parametrize("plan", ["rich", "run-step"])
@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("k", [0.25, 0.5, 2.0, 4.0])
def test_wrong_counts_in_the_profile_are_bad_data(plan: str, axis: str, k: float) -> None:
    """The angles of a log in degrees stay right; its grid shows the encoder's counts."""
    r = flight(plan)
    right = int(getattr(r.profile.encoder, axis))
    encoder = r.profile.encoder.model_copy(update={axis: round(k * right)})
    logged = replace(r, profile=r.profile.model_copy(update={"encoder": encoder}), channels={})
    fault = only(logged)
    assert (fault.check, fault.axis, fault.kind) == ("encoder.grid", axis, Kind.BAD_DATA)
    assert fault.fix.startswith(f"set encoder.{axis} = {right} in the profile")


def as_log(r: Recording, **mapping: str) -> Recording:
    return replace(r, meta={"name": "log", "source": "import", "log_mapping": mapping})


@pytest.mark.parametrize("k", [0.5, 2.0])
def test_a_log_s_wrong_factor_has_one_remedy_which_removes_it(k: float) -> None:
    """The profile's counts do not change the angles of a log."""
    r = flight()
    wrong = as_log(with_angle(r, 1, k * r.angle[:, 1]))
    fault = only(wrong)
    assert (fault.check, fault.axis) == ("encoder.counts", "pitch")
    assert fault.fix == f"import the log with --map pitch_deg=pitch_deg/{k:g}"
    assert names(as_log(with_angle(wrong, 1, wrong.angle[:, 1] / k)), *Kind.ORDER[:3]) == set()


@pytest.mark.parametrize("axis", range(3))
def test_the_remedy_of_a_wrong_sign_suits_the_source_of_the_angle(axis: int) -> None:
    r = turned(axis)(flight())
    name = AXES[axis]
    counts = int(getattr(r.profile.encoder, name))
    assert only(r).fix == f"set encoder.{name} = {-counts} in the profile, and record again"
    assert only(as_log(r)).fix == f"import the log with --map {name}_deg=-{name}_deg"
    mapped = as_log(r, **{f"{name}_rad": "x[3]/2"})
    assert only(mapped).fix == f"import the log with --map '{name}_rad=-(x[3]/2)'"


@pytest.mark.parametrize(("factor", "word"), [(180 / np.pi, "degrees"), (np.pi / 180, "radians")])
def test_a_wrong_angle_unit_is_named(factor: float, word: str) -> None:
    r = flight()
    for fault in integrity(replace(r, angle=factor * r.angle, reference=factor * r.reference)):
        assert (fault.check, fault.kind) == ("angle.unit", Kind.BAD_DATA)
        assert word in fault.cause


def test_raw_counts_are_not_an_angle() -> None:
    r = flight()
    counts = np.round(r.angle / np.abs(r.profile.encoder.rad_per_count))
    assert {f.check for f in integrity(replace(r, angle=counts))} == {"angle.unit"}


@given(axis=AXIS, start_s=st.one_of(st.just(0.0), st.floats(10.0, 35.0)))
@settings(max_examples=12)
def test_a_frozen_encoder_is_named(axis: int, start_s: float) -> None:
    r = flight("rich")
    k = int(np.searchsorted(r.t, start_s))
    q = r.angle[:, axis].copy()
    q[k:] = q[k]
    assert f"encoder.frozen.{AXES[axis]}" in names(with_angle(r, axis, q), Kind.BAD_DATA)


@given(
    axis=AXIS, at_s=st.floats(1.0, 25.0), size_deg=st.floats(2.0, 30.0), up=st.booleans(),
    lasts=st.booleans(),
)  # fmt: skip
@settings(max_examples=12)
def test_a_jump_of_many_counts_is_not_motion(
    axis: int, at_s: float, size_deg: float, up: bool, lasts: bool
) -> None:
    r = flight("run-step", rate_hz=500.0)
    k = int(np.searchsorted(r.t, at_s))
    q = r.angle[:, axis].copy()
    q[k : None if lasts else k + 1] += np.radians(size_deg if up else -size_deg)
    assert f"encoder.jump.{AXES[axis]}" in names(with_angle(r, axis, q), Kind.BAD_DATA)


@pytest.mark.parametrize(("axis", "lasts_s"), [(1, 1.0), (2, 10.0)])
def test_a_jump_after_a_standstill_is_attributed_to_a_frozen_encoder(
    axis: int, lasts_s: float
) -> None:
    r = flight("rich", rate_hz=500.0)
    a, b = np.searchsorted(r.t, [30.0, 30.0 + lasts_s])
    q = r.angle[:, axis].copy()
    q[a:b] = q[a]
    fault = only(with_angle(r, axis, q))
    assert (fault.check, fault.axis) == ("encoder.jump", AXES[axis])
    assert "after staying on one count from" in fault.sentence
    assert "frozen" in fault.cause
    from_s = float(fault.fix.split("between(0, ")[1].rstrip(")"))
    assert from_s == pytest.approx(30.0, abs=0.05)


def test_a_gap_of_two_seconds_is_not_a_jump() -> None:
    r = flight("rich")
    (fault,) = integrity(r.rows((r.t < 30.0) | (r.t >= 32.0)))
    assert fault.check == "timing.hole"


@pytest.mark.parametrize("plan", ["rich", "steps", "run-step"])
def test_a_roll_zeroed_on_the_table_is_bad_data(plan: str) -> None:
    r = flight(plan)
    fault = only(with_angle(r, 0, r.angle[:, 0] - r.angle[0, 0]))
    assert (fault.check, fault.effect, fault.axis) == ("encoder.zero", "encoder.offset", "roll")
    assert fault.parameters["angle_deg"][0] == pytest.approx(27.5, abs=0.1)
    assert "subtract 27.5° from roll" in fault.fix


def test_a_log_zeroed_on_the_table_is_corrected_by_the_expression_of_its_column() -> None:
    r = flight("rich")
    zeroed = with_angle(r, 0, r.angle[:, 0] - r.angle[0, 0])
    assert only(as_log(zeroed)).fix == "import the log with --map 'roll_deg=roll_deg - 27.5'"
    mapped = as_log(zeroed, roll_rad="x[3]/2")
    assert only(mapped).fix == "import the log with --map 'roll_rad=(x[3]/2) - 0.48'"


def test_a_flight_from_level_to_20_deg_was_not_zeroed_on_the_table() -> None:
    """It starts at 0° and never goes below; only gravity shows where the arm is level."""
    plan = step_plan((20.0, None, None), settle_s=0.5, duration_s=20.0)
    r = fly_plan(plan, device="mock:?speed=max&seed=5&start=level", seed=5).recording
    assert names(r.between(0.0, 20.0), Kind.BAD_DATA) == set()


def test_a_flight_from_level_or_with_an_offset_was_not_zeroed_on_the_table() -> None:
    r = flight("large")
    assert names(r.between(12.0, 60.0), Kind.BAD_DATA) == set()
    assert "encoder.zero.roll" not in names(flight("rich", "encoder.offset.roll:4"))


def test_yaw_folded_at_360_degrees_is_named() -> None:
    r = flight("rich")
    yaw = r.angle[:, 2] + np.radians(170)
    folded = np.where(yaw > np.pi, yaw - 2 * np.pi, yaw)
    faults = [f for f in integrity(with_angle(r, 2, folded)) if f.check == "encoder.jump"]
    assert "360" in faults[0].cause
    assert "numpy.unwrap(angle_deg, period=360)" in faults[0].fix


@pytest.mark.parametrize("turn", [360, 180])
def test_the_advised_mapping_unwraps_yaw(tmp_path: Path, turn: int) -> None:
    r = flight("rich")
    yaw = np.degrees(r.angle[:, 2]) + turn / 2 - 10
    folded = np.mod(yaw + turn / 2, turn) - turn / 2
    log = export(with_angle(r, 2, np.radians(folded)), tmp_path / "log.csv")
    imported = import_log(log, r.profile)
    (fault,) = (f for f in integrity(imported) if f.check == "encoder.jump")
    option = fault.fix.partition("--map ")[2].strip("'")
    again = import_log(log, r.profile, mapping=parse_mapping([option]))
    np.testing.assert_allclose(np.degrees(again.angle[:, 2]), yaw, atol=1e-6)


def test_motors_off_or_a_clamped_rig_is_not_identifiable() -> None:
    r = flight("run-step")
    at_rest = np.repeat(r.angle[:1], len(r), axis=0)
    still = replace(r, angle=at_rest)
    assert only(still).kind == Kind.NOT_IDENTIFIABLE
    assert "amplifier" in only(still).cause
    off = replace(still, voltage=np.zeros_like(r.voltage))
    assert only(off).kind == Kind.NOT_IDENTIFIABLE
    assert "motors were off" in only(off).cause


def test_an_arm_that_never_leaves_the_table_is_reported() -> None:
    r = flight("run-step")
    weak = with_angle(r, 0, np.full(len(r), r.angle[0, 0]))
    low = replace(weak, voltage=0.3 * r.voltage, voltage_cmd=0.3 * r.voltage_cmd)
    assert "nothing.flies" in names(low, Kind.NOTE)
    stiff = replace(low, angle=low.angle[:1] + 0.05 * (low.angle - low.angle[:1]))
    assert "nothing.flies" in names(stiff, Kind.NOT_IDENTIFIABLE)
    tripped = replace(stiff, meta={**r.meta, "outcome": "tripped"})
    (fault,) = (f for f in integrity(tripped) if f.check == "nothing.flies")
    assert "ended for safety" in fault.cause


def test_a_safety_stop_is_noted_with_its_reason() -> None:
    r = flight("run-step")
    meta = {**r.meta, "outcome": "tripped", "outcome_details": {"detail": "pitch reached 61°"}}
    (note,) = integrity(replace(r, meta=meta))
    assert (note.check, note.kind) == ("flight.tripped", Kind.NOTE)
    assert "pitch reached 61°" in note.sentence
    assert "encoder's sign" in note.cause
    assert "heli3dof monitor" in note.fix


def test_an_emergency_stop_is_noted_with_the_cause_that_the_flight_recorded() -> None:
    device = "mock:?speed=max&fault=button@4"
    r = fly_plan(step_plan((5.0, None, None)), device=device).recording
    (note,) = (f for f in integrity(r) if f.check == "flight.tripped")
    assert "BUTTON" in note.sentence
    assert "monitor" not in note.sentence + note.fix
    assert note.cause == "somebody pressed the rig's button."
    assert "find out who stopped it and why" in note.fix


def test_a_wrong_yaw_count_that_pitch_may_explain_names_both_axes() -> None:
    # If pitch reads half its angle, pitch flies to its stops and does not respond.
    fault = only(flight("large", "encoder.scale.pitch:0.5"))
    assert fault.check == "encoder.counts"
    assert "pitch" in fault.cause
    assert fault.confidence <= 0.5
