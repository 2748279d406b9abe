"""The motion before a trip identifies the wiring fault, if there is one."""

from __future__ import annotations

import pytest

from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import step_plan

PLAN = step_plan((10.0, None, 20.0), settle_s=8.0, duration_s=8.0)
FAULTS = {
    "reversed.roll@0": "the roll encoder counts the wrong way",
    "reversed.pitch@0": "the pitch encoder counts the wrong way",
    "reversed.yaw@0": "the yaw encoder counts the wrong way",
    "reversed.pitch@6": "the pitch encoder counts the wrong way",
    "reversed.roll@9": "the roll encoder counts the wrong way",
    "swapped@0": "the leads of the two motors are swapped",
    "swapped@6": "the leads of the two motors are swapped",
    "dead.front@0": "the front motor does not pull",
    "dead.back@10": "the back motor does not pull",
    "inverted.front@0": "the front motor turns the wrong way",
    "inverted.back@9": "the back motor turns the wrong way",
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
