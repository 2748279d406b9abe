"""The multi-step fit: on the mock rig with sampling jitter, and on a real rig's log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import heli3dof as h3
from heli3dof.errors import RecordingError
from heli3dof.identification.greybox.freeflight import (
    VARYING,
    fit_freeflight,
    free_rows,
    model_of,
    problem_of,
)
from heli3dof.identification.greybox.method import DEFAULT_TERMS, has_jitter
from heli3dof.identification.greybox.multistep import COMMON_STD, rms_errors, robust
from heli3dof.model.model_file import save_model
from heli3dof.paper.models import load_model
from heli3dof.recording.recording import Recording
from tests.identification.known_flights import fly
from tests.paths import REAL_DATA

RIG_A = REAL_DATA / "rig-a"


def blurred(recording: Recording, sigma_s: float, seed: int) -> Recording:
    """The same flight with sampling jitter of ``sigma_s`` in the angles."""
    t = recording.t
    late = sigma_s * np.random.default_rng(seed).standard_normal(len(t))
    step = np.abs(recording.profile.encoder.rad_per_count)
    angle = [np.interp(t + late, t, recording.angle[:, i]) for i in range(3)]
    return replace(recording, angle=np.round(np.column_stack(angle) / step) * step)


@pytest.fixture(scope="module")
def real() -> Recording:
    if not RIG_A.is_dir():
        pytest.skip("the real recordings are not here")
    return h3.load(RIG_A / "closed-1a.csv", h3.load_profile(RIG_A / "profile.toml"))


def test_the_robust_loss_is_quadratic_for_small_errors_and_linear_for_large() -> None:
    assert robust(np.array([0.1]))[0] == pytest.approx(0.1, rel=1e-3)
    assert robust(np.array([400.0]))[0] ** 2 == pytest.approx(2 * 4.0 * 400, rel=0.02)


def test_the_scale_of_errors_is_their_rms() -> None:
    e = np.array([0.3, -0.3, 0.1, -0.1]).reshape(4, 1, 1) * np.ones((1, 1, 3))
    np.testing.assert_allclose(rms_errors(e), np.sqrt(0.05))


def test_the_prior_is_loose_on_common_inertia_and_tight_on_ratios() -> None:
    problem = problem_of([fly(1022, until_s=40.0).recording.between(0, 25)], DEFAULT_TERMS)
    names = problem.structure.names
    together, apart = np.zeros(problem.dim), np.zeros(problem.dim)
    for a in ("roll", "pitch", "yaw"):
        together[names.index(f"J_{a}")] = 0.2
    apart[names.index("J_pitch")] = 0.2
    assert together @ problem.prior @ together == pytest.approx((0.2 / COMMON_STD) ** 2)
    assert apart @ problem.prior @ apart == pytest.approx((0.2 / 0.04) ** 2)


def test_parameters_are_right_under_sampling_jitter() -> None:
    flight = fly(1023, spread=0.0, until_s=30.0)
    result = fit_freeflight([blurred(flight.recording, 0.003, 1023)], DEFAULT_TERMS)
    truth, at = flight.truth, dict(zip(result.structure.names, result.values, strict=True))
    assert result.noise[3] >= 0.002
    assert at["T_g"] == pytest.approx(truth["T_g"], rel=0.03)
    for name in ("J_roll", "J_pitch", "J_yaw", "stiffness.pendulum.roll.torque_Nm"):
        assert at[name] == pytest.approx(truth[name], rel=0.12)


def test_recordings_without_enough_windows_are_rejected() -> None:
    with pytest.raises(RecordingError, match="windows of 3 s"):
        problem_of([fly(1022, until_s=40.0).recording.between(0, 4)], DEFAULT_TERMS)


def test_the_model_lists_the_recordings_that_were_long_enough_to_fit() -> None:
    whole = fly(1022, until_s=40.0).recording
    long, short = whole.between(0.0, 20.0), whole.between(20.0, 24.1)
    found = h3.identify([long, short], method="freeflight", terms=("encoder.offset.pitch",))
    extra = found.model.to_dict()["extra"]
    assert [r["sha256"] for r in extra["recordings"]] == [long.digest]
    assert len(extra["by_recording"]["encoder.offset.pitch.angle_deg"]) == 1


def test_a_real_take_off_is_usable_from_the_end_of_its_climb(real: Recording) -> None:
    rows = free_rows(real)
    assert real.t[np.flatnonzero(rows)[0]] == pytest.approx(1.35, abs=0.1)


def test_jitter_of_a_real_log_is_detected(real: Recording) -> None:
    assert has_jitter(real)


def test_predictions_re_estimate_the_pitch_encoder_offset(real: Recording, tmp_path) -> None:  # type: ignore[no-untyped-def]
    """Shift pitch by 3°: predictions after 20 s are as good as without the shift."""
    problem = problem_of([real])
    z = problem.start.copy()
    from heli3dof.identification.greybox.multistep import search

    result = search(problem, z, stages_s=((0.25, 0.5, 1.0),))
    model = model_of(result, [real], "rig-a")
    save_model(model, tmp_path / "m.json")
    read = load_model(tmp_path / "m.json", real.profile)
    assert read.varying == VARYING
    moved = replace(real, angle=real.angle + np.radians([0.0, 3.0, 0.0]))
    late = real.t - real.t[0] > 20

    def yaw_error(m, recording: Recording) -> float:  # type: ignore[no-untyped-def]
        e = (m.predict(recording, 2.0) - recording.angle)[late]
        return float(np.degrees(np.sqrt((e[:, 2] ** 2).mean())))

    before, after = yaw_error(read, real), yaw_error(read, moved)
    frozen = replace(read, varying={})
    assert after < before + 0.5
    assert yaw_error(frozen, moved) > after + 2.0
