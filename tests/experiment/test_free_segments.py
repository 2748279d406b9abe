"""Ring-down and coast-down: flown without a trip, and with the motion of the uncontrolled rig."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.comparison.replay import replay
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.experiment.simulate import simulate
from heli3dof.model.control.controller import Controller
from heli3dof.model.greybox.model import GreyBoxModel, nominal
from heli3dof.model.linear.hover import hover_model
from heli3dof.recording.recording import Recording
from heli3dof.recording.row import CLOSED_LOOP
from heli3dof.rig.profile import default_profile
from tests.profiles import profile

PROFILE = default_profile()
J_ROLL = 0.9144546227  # Table I
J_YAW = 0.9508093887


def rig(name: str, **value: float) -> GreyBoxModel:
    """The profile's rigid body with one effect."""
    return nominal(PROFILE, (name,), **{f"{name}.{k}": v for k, v in value.items()})


def free(r: Recording, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Time and angle (rad) of the first stretch in which the axis's loop was open."""
    # An open axis's reference is its own angle.
    own = np.flatnonzero(np.isclose(r.reference[:, axis], r.angle[:, axis], atol=1e-9) & (r.t > 15))
    ends = np.flatnonzero(np.diff(own) > 1)
    stretches = [s for s in np.split(own, ends + 1) if len(s) > 500]
    return r.t[stretches[0]], r.angle[stretches[0], axis]


@pytest.mark.parametrize(
    ("plan", "hide"),
    [
        ("ring-down", "stiffness.pendulum.roll:1.0"),
        ("coast-down", "friction.viscous.yaw:0.1"),
        ("coast-down", ""),
    ],
)
def test_flights_complete_and_their_recording_obeys_the_control_law(plan: str, hide: str) -> None:
    device = f"mock:?speed=max&spread=0.07&hide={hide}"
    flight = fly_plan(load_plan(plan), device=device, seed=1215, profile=profile(rate_hz=250.0))
    assert flight.outcome.ending == "completed"
    r = flight.recording
    flown = np.flatnonzero(r.channels["phase"] == CLOSED_LOOP)
    law = Controller.of(r.profile)
    law.reset(r.angle[0])
    for k in flown:
        _, v = law.step(r.angle[k], r.reference[k], r.voltage_extra[k])
        assert v == tuple(r.voltage[k])
    after = r.t[flown] > 15.0
    assert np.degrees(np.abs(r.angle[flown][after, 1])).max() < 25.0  # no jump
    assert (np.degrees(np.abs(r.angle[flown[-1]])) < [2.0, 2.0, 25.0]).all()  # recovered


def test_a_pendulum_swings_at_its_natural_frequency() -> None:
    r = simulate(load_plan("ring-down"), rig("stiffness.pendulum.roll", torque_Nm=1.0))
    t, roll = free(r, 0)
    crossings = t[:-1][np.diff(np.sign(roll)) != 0]
    # Half of T = 2π √(J_roll/k_r) between crossings, but for 1 − cos r of gravity and the
    # amplitude of 8°; the mean of an upper and a lower half, which an offset shifts.
    half = np.diff(crossings).mean()
    assert half == pytest.approx(np.pi * np.sqrt(J_ROLL / 1.0), rel=0.03)


def test_viscous_friction_slows_a_coasting_yaw_exponentially() -> None:
    # Ideal encoders: a pitch a quarter of a count off level would push yaw.
    body = rig("friction.viscous.yaw", damping_Nms_per_rad=0.2)
    r = simulate(load_plan("coast-down"), body, quantised=False)
    t, yaw = free(r, 2)
    t, yaw = t[1000:] - t[1000], yaw[1000:]  # the body is level by then
    # ψ̇ ∝ exp(−c t/J): the ratio of two equal stretches' travel is exp(−c T/J).
    n = len(t) // 2
    ratio = (yaw[2 * n - 1] - yaw[n]) / (yaw[n] - yaw[0])
    assert ratio == pytest.approx(np.exp(-0.2 * t[n] / J_YAW), rel=0.005)


def test_without_stiffness_the_loop_closes_before_the_envelope() -> None:
    slow = profile(rate_hz=250.0)
    flight = fly_plan(load_plan("ring-down"), device="mock:?speed=max", seed=1216, profile=slow)
    assert flight.outcome.ending == "completed"
    after = flight.recording.t > 12.0
    assert np.degrees(flight.recording.angle[after, 0].max()) < 30.0


@pytest.mark.parametrize("plan", ["ring-down", "coast-down"])
def test_simulations_on_any_model_replay_exactly(plan: str) -> None:
    body = rig("stiffness.pendulum.roll", torque_Nm=1.0)
    for model in (hover_model(PROFILE), body):
        flown = simulate(load_plan(plan), model, start="level")
        again = replay(model, flown)
        grain = PROFILE.encoder.rad_per_count
        assert again.diverged_at_s is None
        np.testing.assert_array_equal(np.round(again.angle / grain) * grain, flown.angle)
