"""The LQR gain of the paper's rig is the paper's, and other rigs get one that flies them."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.errors import CheckFailed
from heli3dof.model.control.lqr import is_default_gain, lqr_gain
from heli3dof.rig.profile import K_G, TABLE_I, Profile, profile_from_dict
from heli3dof.rig.profile_file import merged


def rig(**sections: dict[str, float]) -> Profile:
    return profile_from_dict(merged(TABLE_I, sections))


def test_the_papers_rig_gets_the_papers_gain() -> None:
    gain = lqr_gain(rig())
    assert gain[0] == pytest.approx(
        (37.6707, 13.2126, -11.4978, 20.9542, 4.7687, -16.0993, 10.0, -1.0), abs=6e-4
    )
    assert is_default_gain(gain)
    assert not is_default_gain(lqr_gain(rig(geometry={"L_a": 0.4})))


def test_half_the_amplifiers_voltage_asks_for_half_the_volts() -> None:
    full, half = np.array(lqr_gain(rig())), np.array(lqr_gain(rig(motor={"v_max": 12.0})))
    assert half[:, 6:] == pytest.approx(0.5 * full[:, 6:])


def test_a_counterweight_heavy_rig_tilts_the_other_way_to_turn() -> None:
    up = np.array(lqr_gain(rig()))
    down = np.array(lqr_gain(rig(motor={"V_o": -7.456})))
    assert down[:, [2, 5, 7]] == pytest.approx(-up[:, [2, 5, 7]], rel=1e-3)
    assert down[:, [0, 1, 3, 4, 6]] == pytest.approx(up[:, [0, 1, 3, 4, 6]], rel=1e-3)


def test_without_hover_thrust_there_is_no_gain() -> None:
    with pytest.raises(CheckFailed, match="No LQR gain"):
        lqr_gain(rig(motor={"V_o": 0.0}))


def test_rows_are_mirrored_front_to_back() -> None:
    assert np.array(K_G)[1] == pytest.approx(np.array(K_G)[0] * [1, -1, -1, 1, -1, -1, 1, -1])
