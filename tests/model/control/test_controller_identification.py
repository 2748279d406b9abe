"""The controller of a log is identified, to the accuracy of the logged numbers."""

from __future__ import annotations

import doctest
from dataclasses import replace

import numpy as np
import pytest

from heli3dof.identification.bias_correction.simulated_flight import simulated_flight
from heli3dof.model.control import controller_identification as module
from heli3dof.model.control import unexplained_share
from heli3dof.model.control.controller import derivative_filter
from heli3dof.model.control.controller_identification import identified_controller, law_of_order
from heli3dof.model.control.loop_task import under_control
from heli3dof.model.control.voltage_replay import controller_is_known, with_known_controller
from heli3dof.model.greybox.model import nominal
from heli3dof.recording import linear_controller
from heli3dof.recording.linear_controller import LinearController
from heli3dof.recording.load import load
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import load_profile
from tests.flown import flown
from tests.paths import REAL_DATA, needs_real_data
from tests.profiles import profile


def without_controller(r: Recording) -> Recording:
    return replace(r, profile=r.profile.model_copy(update={"controller": None}))


@pytest.fixture(scope="module")
def steps() -> Recording:
    rig = profile(rate_hz=250.0)
    return flown("steps", 45.0, device="mock:?speed=max&start=level", seed=3, profile=rig)


@pytest.fixture(scope="module")
def law(steps: Recording) -> LinearController:
    found = identified_controller(steps)
    assert found is not None
    return found


def test_the_doctests_pass() -> None:
    assert doctest.testmod(module).failed == 0
    assert doctest.testmod(unexplained_share).failed == 0
    assert doctest.testmod(linear_controller).failed == 0


def test_the_gains_on_the_angles_are_those_of_the_controller(steps: Recording) -> None:
    """The rates' filter passes b0 of each angle at once: B_0 = −(K_angle + b0 K_rate)."""
    spec = steps.profile.controller
    assert spec is not None
    b0, *_ = derivative_filter(spec, steps.profile.dt)
    K = np.array(spec.K)
    law = identified_controller(without_controller(steps))
    assert law is not None
    assert law.share < 0.01
    assert len(law.A) == 3
    assert law.B[0] == pytest.approx(-(K[:, :3] + b0 * K[:, 3:6]), rel=0.01)


@pytest.mark.parametrize("motors", [[0, 1], [0]])
def test_rows_with_a_motor_off_do_not_change_the_law(steps: Recording, motors: list[int]) -> None:
    """After a power cut, or if one motor stops, the voltages do not follow from the angles."""
    cut = len(steps) * 4 // 5
    voltage = steps.voltage.copy()
    voltage[cut:, motors] = 0.0
    law = identified_controller(replace(steps, voltage=voltage))
    expected = identified_controller(steps.rows(slice(0, cut)))
    assert law is not None
    assert expected is not None
    np.testing.assert_array_equal(law.B, expected.B)


def test_lost_samples_do_not_change_the_law(steps: Recording, law: LinearController) -> None:
    kept = np.flatnonzero(np.random.default_rng(0).random(len(steps)) > 0.1)
    of_some = identified_controller(steps.rows(kept))
    assert of_some is not None
    np.testing.assert_allclose(of_some.B[0], law.B[0], atol=0.01)


def test_superfluous_modes_of_a_law_do_not_grow(steps: Recording) -> None:
    """An order above the controller's adds modes that the voltages do not determine."""
    for order in (4, 6):
        law = law_of_order(under_control(steps), order)
        assert law is not None
        assert law.share < 0.01
        companion = np.eye(2 * order, k=-2)
        companion[:2] = np.hstack(list(law.A))
        assert np.abs(np.linalg.eigvals(companion)).max() < 1 + 1e-6


def test_with_the_recorded_angles_the_law_has_the_recorded_voltages(
    steps: Recording, law: LinearController
) -> None:
    w, n = law.input_of(steps.voltage, steps.angle), len(law.A)
    k = np.arange(n, len(steps))
    v = w[k].copy()
    v += sum(steps.voltage[k - j] @ law.A[j - 1].T for j in range(1, n + 1))
    v += sum(steps.angle[k - j] @ law.B[j].T for j in range(n + 1))
    np.testing.assert_allclose(v, steps.voltage[k], atol=1e-9)


def test_flights_simulated_with_the_law_are_those_with_the_profile_s_controller(
    steps: Recording,
) -> None:
    """Both controllers get the same noise. The angles stay within a few encoder steps."""
    bare = with_known_controller(without_controller(steps))
    assert controller_is_known([bare])
    model = replace(nominal(steps.profile, ()), noise=np.array([0.004, 0.01, 0.003]))
    one, two = (simulated_flight(model, r, np.random.default_rng(5)) for r in (steps, bare))
    step = np.abs(steps.profile.encoder.rad_per_count)
    assert (np.abs(one.angle - two.angle).std(axis=0) < 5 * step).all()
    assert np.abs(one.angle - steps.angle).std() > 0


def test_noise_in_the_voltages_leaves_the_controller_unknown(steps: Recording) -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.01, steps.voltage.shape)
    assert identified_controller(replace(steps, voltage=steps.voltage + noise)) is None


def test_an_excitation_that_was_not_logged_does_not_change_the_law() -> None:
    rig = profile(rate_hz=250.0)
    r = flown("prbs", 30.0, device="mock:?speed=max&start=level", seed=3, profile=rig)
    laws = (identified_controller(replace(r, voltage_extra=x))
            for x in (r.voltage_extra, np.full_like(r.voltage, np.nan)))  # fmt: skip
    (one, two) = (law.B[0] for law in laws if law is not None)
    np.testing.assert_allclose(one, two, rtol=0.01)


def test_without_references_an_integral_is_not_identifiable(steps: Recording) -> None:
    """Its voltage would be part of w, and simulated flights would repeat the effect of a torque."""
    assert (
        identified_controller(replace(steps, reference=np.full_like(steps.angle, np.nan))) is None
    )


@pytest.mark.parametrize("lost", ["an axis", "a sample of an angle", "most rows"])
def test_a_log_with_too_little_data_has_no_identified_controller(
    steps: Recording, lost: str
) -> None:
    angle = steps.angle.copy()
    if lost == "most rows":
        assert identified_controller(steps.between(10.0, 10.4)) is None
        return
    if lost == "an axis":
        angle[:, 2] = np.nan
    else:
        angle[1000, 1] = np.nan
    assert identified_controller(replace(steps, angle=angle)) is None


@needs_real_data
@pytest.mark.parametrize(
    "log", ["rig-a/closed-1a", "rig-a/closed-2a", "rig-b/closed-03", "rig-b/closed-08"]
)
def test_the_controllers_of_two_laboratories_are_linear_and_of_second_order(log: str) -> None:
    rig = log.partition("/")[0]
    profile = load_profile(REAL_DATA / rig / "profile.toml")
    recording = load(REAL_DATA / f"{log}.csv", profile=profile)
    lower, law = (module.law_of_order(recording, n) for n in (1, 2))
    assert lower is not None
    assert law is not None
    assert law.share < module.MAX_SHARE < 0.1 * lower.share
    assert (identified_controller(recording) is not None) == (rig == "rig-a")  # with references
