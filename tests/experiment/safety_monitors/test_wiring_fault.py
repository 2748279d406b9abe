"""The motion before a trip identifies the wiring fault, if there is one."""

from __future__ import annotations

import pytest

from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan, plan_from_dict, step_plan

PLAN = step_plan((10.0, None, 20.0), settle_s=8.0, duration_s=8.0)
SHORT = plan_from_dict(
    {
        "name": "short",
        "segment": [
            {"kind": "hold", "duration_s": 2},
            {"kind": "step", "roll_deg": 3, "yaw_deg": 10, "duration_s": 4},
        ],
    }
)
FAULTS = {
    "reversed.roll@0": "the roll encoder counts the wrong way",
    "reversed.pitch@0": "the pitch encoder counts the wrong way",
    "reversed.yaw@0": "the yaw encoder counts the wrong way",
    "swapped@0": "the leads of the two motors are swapped",
    "dead.front@0": "the front motor does not pull",
    "dead.back@10": "the back motor does not pull",
    "inverted.front@0": "the front motor turns the wrong way",
    "inverted.back@0": "the back motor turns the wrong way",
}


def tripped(fault: str, seed: int) -> str:
    device = f"mock:?speed=max&seed={seed}&spread=0.1&fault={fault}"
    outcome = fly_plan(PLAN, device=device).outcome
    assert outcome.ending == "tripped", outcome.detail
    return outcome.detail


@pytest.mark.parametrize(("fault", "message"), FAULTS.items())
def test_a_wiring_fault_is_identified(fault: str, message: str) -> None:
    assert tripped(fault, 5).startswith(f"{message}: ")


@pytest.mark.parametrize(
    ("at_s", "seed"), [(1.8, 4), (2.1, 3), (2.5, 3), (3.0, 3), (3.3, 3), (4.2, 3)]
)
def test_a_failed_supply_is_identified(at_s: float, seed: int) -> None:
    device = f"mock:?speed=max&seed={seed}&fault=dead.front@{at_s},dead.back@{at_s}"
    assert fly_plan(SHORT, device=device).outcome.detail.startswith("no motor pulls: ")


def test_a_supply_that_failed_before_the_flight_is_a_likely_cause() -> None:
    device = "mock:?speed=max&seed=3&fault=dead.front@0,dead.back@0"
    outcome = fly_plan(PLAN, device=device).outcome
    assert outcome.advice()["likely_cause"].startswith("no motor pulls (supply, fuse, plug)")


@pytest.mark.parametrize("fault", ["reversed.roll@9", "reversed.pitch@9", "swapped@9"])
def test_a_wiring_fault_that_earlier_motion_contradicts_is_not_reported(fault: str) -> None:
    detail = tripped(fault, 5)
    assert "wrong way" not in detail
    assert "swapped" not in detail


@pytest.mark.parametrize(
    ("axis", "at_s", "seed"),
    [("roll", 8.6, 6), ("pitch", 8.6, 6), ("yaw", 8.6, 6), ("yaw", 9.0, 1), ("roll", 6.0, 2)],
)
def test_a_frozen_encoder_is_no_wiring_fault(axis: str, at_s: float, seed: int) -> None:
    detail = tripped(f"frozen.{axis}@{at_s}", seed)
    assert detail.startswith(f"the {axis} encoder's count stood at")


@pytest.mark.parametrize(("axis", "at_s"), [("yaw", 6), ("pitch", 6)])
def test_an_encoder_that_freezes_in_a_yaw_step_did_not_count_the_wrong_way(
    axis: str, at_s: int
) -> None:
    device = f"mock:?speed=max&seed=1&fault=frozen.{axis}@{at_s}"
    plan = step_plan((None, None, 20.0), settle_s=5.0, duration_s=8.0)
    detail = fly_plan(plan, device=device).outcome.detail
    assert detail.startswith(f"the {axis} encoder's count stood at")


def test_yaw_that_followed_an_earlier_step_did_not_count_the_wrong_way() -> None:
    device = "mock:?speed=max&seed=0&hide=other.yaw_torque_from_roll_rate_squared:2"
    outcome = fly_plan(load_plan("rich"), device=device).outcome
    assert outcome.ending == "tripped"
    assert outcome.detail.startswith("pitch stood at")
