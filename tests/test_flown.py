"""A test's flight has the rows of the same flight with safety monitors, whole or in part."""

from __future__ import annotations

import numpy as np

from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import plan_from_dict
from tests.flown import flown


def test_the_first_part_of_a_flight_is_that_of_the_whole_flight() -> None:
    """With noise of the rig, signals drawn per segment, and an end within a segment."""
    multisine = {"kind": "multisine", "duration_s": 3.0, "common_V": 0.7, "difference_V": 0.9}
    segments = [{"kind": "hold", "duration_s": 2.0}, multisine, multisine]
    plan = plan_from_dict({"name": "short", "segment": segments})
    device = "mock:?speed=max&spread=0.07&hide=timing.gaps:0.05"
    whole = fly_plan(plan, device=device, seed=7).recording
    for until_s in (6.0, None):
        expected = whole if until_s is None else whole.between(0.0, until_s)
        part = flown(plan, until_s, device=device, seed=7)
        for name in ("t", "angle", "voltage", "reference", "voltage_cmd", "voltage_extra"):
            np.testing.assert_array_equal(getattr(part, name), getattr(expected, name))
        for name, values in part.channels.items():
            if name != "host_time_s":
                np.testing.assert_array_equal(values, expected.channels[name], err_msg=name)
