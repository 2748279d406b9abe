from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.comparison.replay import replay
from heli3dof.model.control.loop_task import loop_task, under_control, why_not_replayed
from heli3dof.rig.profile import default_profile
from tests.comparison.fakes import FakeHover, flight


def test_the_replay_of_the_true_model_is_the_flight_itself() -> None:
    recording = flight(start_deg=(-5.0, 1.0, 0.0))
    flown = replay(FakeHover(), recording)
    assert flown.diverged_at_s is None
    np.testing.assert_allclose(flown.angle, recording.angle, atol=1e-9)


def test_the_reference_step_peaks_where_the_paper_s_model_does() -> None:
    """Ideal rates, no reference limit: 11.85° at 1.77 s, 10.10° at 10 s (paper-checked)."""
    flown = replay(FakeHover(), flight())
    roll = np.degrees(flown.angle[:, 0])
    assert roll.max() == pytest.approx(11.85, abs=0.03)
    assert flown.t[roll.argmax()] == pytest.approx(1.77, abs=0.03)
    assert roll[-1] == pytest.approx(10.10, abs=0.01)


def test_an_unknown_controller_is_not_replayed_and_the_reason_is_given() -> None:
    recording = flight()
    unknown = replace(recording, profile=default_profile().model_copy(update={"controller": None}))
    assert "controller is unknown" in str(why_not_replayed(unknown))
    with pytest.raises(ValueError, match="controller is unknown"):
        loop_task(unknown)


def test_a_flight_without_reference_or_angle_is_not_replayed() -> None:
    recording = flight()
    nothing = replace(recording, reference=np.full_like(recording.reference, np.nan))
    assert "no reference" in str(why_not_replayed(nothing))
    no_yaw = recording.angle.copy()
    no_yaw[:, 2] = np.nan
    assert "yaw angle" in str(why_not_replayed(replace(recording, angle=no_yaw)))


def test_lost_samples_do_not_shorten_the_loop_s_task() -> None:
    recording = flight()
    keep = np.ones(len(recording), dtype=bool)
    keep[700:760] = False
    task = loop_task(recording.rows(keep))
    assert len(task.reference) == len(recording)
    flown = replay(FakeHover(), recording.rows(keep))
    np.testing.assert_allclose(flown.angle, recording.angle[keep], atol=1e-9)


def test_a_late_sample_keeps_its_own_control_period() -> None:
    """Host clocks jitter: a reference that changed at sample k applies in period k."""
    recording = flight()
    late = np.random.default_rng(3).uniform(0, 0.4 * recording.dt, len(recording))
    late[0] = 0.0
    reference = recording.reference.copy()
    reference[:1000] = 0.0
    jittered = replace(recording, t=recording.t + late, reference=reference)
    task = loop_task(jittered)
    assert int(np.argmax(task.reference[:, 0] > 0)) == 1000


def test_the_ramp_down_is_not_replayed() -> None:
    recording = flight()
    reference = recording.reference.copy()
    reference[-250:] = np.nan
    ramped = replace(recording, reference=reference)
    assert len(under_control(ramped)) == len(recording) - 250
    assert len(replay(FakeHover(), ramped).t) == len(recording) - 250
    # heli3dof's recordings keep the reference in the ramp; their phase marks the ramp.
    phase = np.where(np.arange(len(recording)) < 4000, 0.0, 1.0)
    ours = replace(recording, channels={"phase": phase})
    assert len(replay(FakeHover(), ours).t) == 4000


def test_a_diverging_model_has_a_time_and_is_cut_there() -> None:
    """(10) as printed: K_g leaves a pole at +1.469 (E3); a disturbance in pitch excites it."""
    recording = flight(yaw_deg=5.0, duration_s=20.0)
    flown = replay(FakeHover(yaw_sign=+1.0), recording)
    assert flown.diverged_at_s is not None
    assert 2.0 < flown.diverged_at_s < 12.0
    before = flown.t < flown.diverged_at_s - 0.01
    assert np.isfinite(flown.angle[before]).all()
    assert np.abs(np.degrees(flown.angle[before, :2])).max() < 200
    assert np.isnan(flown.angle[flown.t > flown.diverged_at_s]).all()
    assert flown.unstable_poles[0].real == pytest.approx(1.469)
