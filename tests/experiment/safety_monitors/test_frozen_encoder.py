"""A frozen encoder is reported, a live one is not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import cos, pi, radians, sin
from pathlib import Path

import numpy as np
import pytest

from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.safety_monitors.axis_observer import (
    BANDWIDTH,
    AxisObserver,
    ExpectedAcceleration,
)
from heli3dof.experiment.safety_monitors.frozen_encoder import FrozenEncoder
from heli3dof.experiment.safety_monitors.silent_encoder import SilentEncoder
from heli3dof.rig.profile import load_profile
from tests.experiment.safety_monitors.hovering import hover
from tests.experiment.safety_monitors.periods import DT, HOVER, LEVEL, PROFILE, period
from tests.paths import REAL_DATA, needs_real_data

Q = abs(PROFILE.encoder.rad_per_count)
EXPECTED = ExpectedAcceleration(PROFILE)


def first(monitor: Callable[[Period], str | None], periods: Iterator[Period]) -> tuple[float, str]:
    """Time (s) and text of the first report; (inf, "") without one."""
    for now in periods:
        if (report := monitor(now)) is not None:
            return now.t, report
    return float("inf"), ""


def test_the_expected_acceleration_at_level_hover_is_zero() -> None:
    assert EXPECTED((0.0, 0.0, 0.0), HOVER, HOVER) == pytest.approx((0, 0, 0), abs=1e-12)


def test_one_volt_more_on_both_motors_lifts_by_the_papers_number() -> None:
    """Eq (10): 2 L_a K_f / J_roll = 2 · 0.6604 · 0.1188 / 0.9145 = 0.1716 rad/s² a volt."""
    roll, pitch, _ = EXPECTED((0.0, 0.0, 0.0), HOVER + 1, HOVER + 1)
    assert (roll, pitch) == pytest.approx((0.1716, 0.0), abs=2e-4)


def test_the_observer_estimates_rate_and_unmodelled_acceleration() -> None:
    observer = AxisObserver(BANDWIDTH[0])
    observer.restart(0.0)
    for k in range(1, 1500):
        observer.step(DT, 0.2, 0.5 * 0.5 * (k * DT) ** 2)
    assert observer.rate == pytest.approx(0.5 * 1499 * DT, rel=1e-3)
    assert observer.unmodelled == pytest.approx(0.3, rel=1e-3)


def rocking(axis: int, freeze_s: float, seconds: float, amplitude_deg: float) -> Iterator[Period]:
    """A rig that rocks about one axis as the model demands; its count freezes at ``freeze_s``."""
    w = 2 * pi / 2.0
    held: int | None = None
    for k in range(round(seconds / DT)):
        t = k * DT
        angle = radians(amplitude_deg) * sin(w * t)
        acceleration = -(w**2) * angle
        count = round(angle / Q[axis])
        if t >= freeze_s:
            held = count if held is None else held
            count = held
        counts, volts = [LEVEL, 0, 0], [HOVER, HOVER]
        if axis == 0:
            counts[0] += count
            change = acceleration / EXPECTED.roll_per_V / 2
            volts = [HOVER * cos(angle) + change, HOVER * cos(angle) + change]
        else:
            counts[1] = count
            change = acceleration / EXPECTED.pitch_per_V / 2
            volts = [HOVER + change, HOVER - change]
        yield period(k, counts=(counts[0], counts[1], counts[2]), v_applied=(volts[0], volts[1]))


@pytest.mark.parametrize(("axis", "name"), [(0, "roll"), (1, "pitch")])
def test_a_count_that_freezes_in_motion_is_reported_within_half_a_second(
    axis: int, name: str
) -> None:
    at_s, report = first(FrozenEncoder(PROFILE), rocking(axis, 10.05, 12.0, 5.0))
    assert 10.05 < at_s < 10.55
    assert f"the {name} encoder's count stood at" in report
    assert "the encoder is frozen" in report.cause  # type: ignore[attr-defined]


@pytest.mark.parametrize("axis", [0, 1])
def test_a_live_axis_that_rocks_is_not_reported(axis: int) -> None:
    assert first(FrozenEncoder(PROFILE), rocking(axis, 1e9, 20.0, 5.0))[1] == ""


@pytest.mark.parametrize("cut_s", [0.335, 0.34, 0.345, 0.35, 0.355])
def test_an_arm_that_is_caught_in_its_fall_is_not_reported(cut_s: float) -> None:
    """A flight begins while the arm falls at 44°/s, catches it, and ends at ``cut_s``.

    The arm then stands for 0.1 s where it turns back. The observer takes it to fall still.
    """

    def caught() -> Iterator[Period]:
        angle, rate = radians(-10.0), radians(-44.0)
        for k in range(400):
            volts = 2.8 * HOVER if k * DT < cut_s else 0.0
            counts = (LEVEL + round(angle / Q[0]), 0, 0)
            yield period(k, counts=counts, v_applied=(volts, volts))
            rate += EXPECTED((angle, 0.0, 0.0), volts, volts)[0] * DT
            angle += rate * DT

    assert first(FrozenEncoder(PROFILE), caught()) == (float("inf"), "")


def test_constant_voltages_are_no_evidence_whatever_the_profile() -> None:
    steady = (period(k, v_applied=(2 * HOVER, 0.5 * HOVER)) for k in range(5000))
    assert first(FrozenEncoder(PROFILE), steady)[1] == ""


def test_fast_oscillating_voltages_are_no_evidence() -> None:
    def shaken() -> Iterator[Period]:
        for k in range(5000):
            d = 6.0 if k % 10 < 5 else -6.0
            yield period(k, v_applied=(HOVER + d, HOVER + d))

    assert first(FrozenEncoder(PROFILE), shaken())[1] == ""


def test_a_rig_at_rest_on_its_table_is_not_reported() -> None:
    resting = (
        period(k, counts=(0, 0, 0), v_applied=(0.85 * HOVER, 0.85 * HOVER)) for k in range(5000)
    )
    assert first(FrozenEncoder(PROFILE), resting)[1] == ""


def test_a_thrust_that_lifts_any_rig_without_a_count_is_a_frozen_roll() -> None:
    def lifted() -> Iterator[Period]:
        for k in range(500):
            v = min(20.0, 0.1 * k)
            yield period(k, counts=(0, 0, 0), v_applied=(v, v))

    at_s, report = first(FrozenEncoder(PROFILE), lifted())
    assert at_s < 0.8
    assert "the roll encoder's count stood at 0" in report


def test_an_axis_pushed_against_its_mechanical_stop_is_reported_as_such() -> None:
    def pushed(ramping_down: bool) -> Iterator[Period]:
        for k in range(2000):
            counts = (LEVEL, min(round(k * 0.5), 364), k % 3)
            volts = (HOVER, HOVER) if k < 900 else (HOVER + 8, HOVER - 8)
            yield period(k, counts=counts, v_applied=volts)._replace(ramping_down=ramping_down)

    report = first(FrozenEncoder(PROFILE), pushed(False))[1]
    assert "pitch stood at 32.0°" in report
    assert "it is at its mechanical stop" in report
    assert first(FrozenEncoder(PROFILE), pushed(True))[1] == "", "in the ramp it may rest there"


def test_a_roll_that_does_not_fall_without_thrust_is_reported() -> None:
    frozen = FrozenEncoder(PROFILE)

    def ramp() -> Iterator[Period]:
        for k in range(2500):
            share = max(0.0, 1 - max(0, k - 1000) / 1000)
            v = HOVER * share
            counts = (LEVEL + (k // 40) % 2 if k < 1000 else LEVEL, 0, 0)
            yield period(k, counts=counts, v_applied=(v, v))._replace(ramping_down=k >= 1000)

    at_s, report = first(frozen, ramp())
    assert at_s < 4.0
    assert "the roll encoder" in report
    assert frozen.awaits_fall()


@pytest.mark.parametrize(("axis", "within_s"), [("pitch", 10.0), ("yaw", 30.0)])
def test_an_encoder_that_freezes_in_a_calm_hover_is_reported(axis: str, within_s: float) -> None:
    outcome = hover(30.0 + within_s, 1, f"&fault=frozen.{axis}@30")
    assert outcome.ending == "tripped"
    assert f"the {axis} encoder" in outcome.detail


def test_a_calm_hover_is_flown_to_its_end() -> None:
    assert hover(100.0, 2).ending == "completed"


REAL = sorted(REAL_DATA.glob("rig-*/closed-*.csv"))


@needs_real_data
@pytest.mark.parametrize("own", [True, False], ids=["own profile", "the paper's profile"])
@pytest.mark.parametrize("path", REAL, ids=lambda path: path.stem)
def test_a_real_flight_is_not_reported(path: Path, own: bool) -> None:
    profile = load_profile(path.parent / "profile.toml") if own else PROFILE
    log = np.genfromtxt(path, delimiter=",", names=True)
    rest, q = profile.encoder.rest_rad, profile.encoder.rad_per_count
    angles = np.radians(np.column_stack([log[f"{axis}_deg"] for axis in ("roll", "pitch", "yaw")]))
    counts = np.rint((angles - rest) / q).astype(int).tolist()
    monitors = (FrozenEncoder(profile), SilentEncoder(profile))
    for k, t in enumerate((log["t_s"] - log["t_s"][0]).tolist()):
        volts = (float(log["v_front_V"][k]), float(log["v_back_V"][k]))
        now = period(k, counts=tuple(counts[k]), v_applied=volts)
        now = now._replace(t=t, angle=tuple(angles[k].tolist()))
        for monitor in monitors:
            assert monitor(now) is None, t
