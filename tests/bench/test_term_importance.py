"""Each term's share: the error of the model without it, all else unchanged."""

from __future__ import annotations

from dataclasses import replace

import pytest

from heli3dof.model.greybox.model import nominal
from heli3dof.rig.profile import default_profile
from tests.bench.term_importance import without


def test_a_removed_term_is_at_its_null_and_the_others_keep_their_values() -> None:
    model = nominal(default_profile(), ("bias.torque.yaw", "motor.lag"))
    model = replace(model, values=model.values + 0.01, varying={"bias.torque.yaw.torque_Nm": 1.0})
    bare = without(model, "bias.torque.yaw")
    assert bare.parameters["bias.torque.yaw.torque_Nm"] == 0.0
    assert bare.varying == {}
    assert bare.parameters["motor.lag.time_constant_s"] == pytest.approx(0.09)
