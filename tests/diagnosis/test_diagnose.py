"""`diagnose` end to end: an unmodified rig has no finding.

tests/cli/test_diagnose.py has a hidden effect, named with its size.
"""

from __future__ import annotations

from heli3dof.diagnosis.diagnose import diagnose
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import Plan, step_plan
from heli3dof.recording.recording import Recording


def flight(plan: Plan, hide: str, seed: int) -> Recording:
    device = f"mock:?speed=max&hide={hide}&seed={seed}&spread=0.07"
    return fly_plan(plan, device=device, seed=seed).recording


def test_a_step_flight_of_the_unmodified_rig_has_no_finding() -> None:
    result = diagnose(flight(step_plan((10.0, None, None)), "", 1102), quick=True)
    assert result.verdict == "off_calibration"  # the rig is up to 7 % off its profile
    assert not result.findings
    assert "drag.quadratic.yaw" in result.not_identifiable
