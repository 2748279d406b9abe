"""`wrong_lengths`: usual mistakes in the profile's lengths, found from the fitted ratios K_f/J."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.axes import AXES
from heli3dof.diagnosis.conclusion.wrong_lengths import wrong_lengths
from heli3dof.identification.greybox.thrust_scale import Measured
from heli3dof.rig.profile import Profile, default_profile


def with_lengths(**lengths: float) -> Profile:
    p = default_profile()
    return p.model_copy(update={"geometry": p.geometry.model_copy(update=lengths)})


def ratios_of(truth: Profile, assumed: Profile) -> dict[str, Measured]:
    """Return K_f/J of a fit with the profile ``assumed`` to a flight of the rig ``truth``.

    Both simulate the same accelerations per volt at level hover: arm · K_f/J.
    """
    arms = [(p.geometry.L_a, p.geometry.L_h, p.geometry.L_a) for p in (truth, assumed)]
    K_f = truth.motor.K_f
    fitted = K_f * np.array(arms[0]) / truth.inertias / arms[1]
    return {
        f"K_f/J_{a}": Measured(K_f / J, float(v), 0.01)
        for a, J, v in zip(AXES, assumed.inertias, fitted, strict=True)
    }


RIGHT = default_profile().geometry.model_dump()


@pytest.mark.parametrize(
    "wrong",
    [
        {"L_h": 2 * RIGHT["L_h"]},
        {"L_h": RIGHT["L_h"] / 2},
        {"L_a": RIGHT["L_w"], "L_w": RIGHT["L_a"]},
    ],
)
def test_a_mistake_is_found_whatever_a_few_per_cent_of_error(wrong: dict[str, float]) -> None:
    assumed = with_lengths(**wrong)
    fitted = ratios_of(default_profile(), assumed)
    fitted = {
        n: Measured(m.nominal, m.value * k, m.std)
        for (n, m), k in zip(fitted.items(), (1.03, 0.97, 1.02), strict=True)
    }
    found = wrong_lengths(assumed, fitted)
    assert found == {name: pytest.approx(RIGHT[name]) for name in wrong}


def test_inertias_within_the_tolerance_or_of_another_rig_show_no_wrong_length() -> None:
    p = default_profile()
    right = ratios_of(p, p)
    assert wrong_lengths(p, right) == {}
    pitch = right["K_f/J_pitch"]
    for factor in (1.2, 1.3, 3.3):
        off = {"K_f/J_pitch": Measured(pitch.nominal, pitch.value * factor, pitch.std)}
        assert wrong_lengths(p, right | off) == {}
    del right["K_f/J_pitch"]
    assert wrong_lengths(p, right) == {}
