"""Each kind of segment renders its equation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heli3dof.experiment.plan import Signals, plan_from_dict
from heli3dof.experiment.segments import BaseSegment, kinds

DT = 0.002


def render(*segments: dict, seed: int = 1) -> Signals:
    return plan_from_dict({"name": "t", "segment": list(segments)}).render(DT, seed)


def test_a_ramp_reaches_its_target_at_a_constant_rate() -> None:
    signals = render({"kind": "ramp", "roll_deg": 10.0, "common_V": 2.0, "duration_s": 5.0})
    roll = np.degrees(signals.reference[:, 0])
    assert roll[-1] == pytest.approx(10)
    np.testing.assert_allclose(np.diff(roll), 2.0 * DT, rtol=1e-9)  # 10° in 5 s
    np.testing.assert_allclose(signals.extra[-1], [2.0, 2.0])


def test_a_doublet_is_one_pulse_up_and_one_down() -> None:
    signals = render({"kind": "doublet", "difference_V": 1.5, "pulse_s": 0.2, "duration_s": 1.0})
    front, back = signals.extra.T
    assert (front[:100] == 1.5).all()
    assert (front[100:200] == -1.5).all()
    assert (front[200:] == 0).all()
    np.testing.assert_array_equal(back, -front)
    assert front.sum() == 0


def test_a_chirp_sweeps_from_the_first_to_the_last_frequency() -> None:
    signals = render({"kind": "chirp", "band_Hz": [0.5, 8.0], "duration_s": 20.0})
    rising = np.flatnonzero((signals.extra[:-1, 0] < 0) & (signals.extra[1:, 0] >= 0)) * DT
    middle = (rising[1:] + rising[:-1]) / 2
    np.testing.assert_allclose(1 / np.diff(rising), 0.5 * 16 ** (middle / 20), rtol=0.03)
    assert middle[0] < 3  # starts slowly
    assert 1 / (rising[-1] - rising[-2]) > 7.5  # and reaches the last frequency


@given(seed=st.integers(0, 2**31))
def test_a_prbs_takes_two_values_and_holds_its_bits(seed: int) -> None:
    keys = {"common_V": 0.5, "difference_V": 0.25, "bit_s": 0.1}
    extra = render({"kind": "prbs", "duration_s": 60.0, **keys}, seed=seed).extra
    common, difference = extra.sum(axis=1) / 2, (extra[:, 0] - extra[:, 1]) / 2
    assert set(np.round(common, 9)) == {-0.5, 0.5}
    assert set(np.round(difference, 9)) == {-0.25, 0.25}
    assert (np.flatnonzero(np.diff(common)) % 50 == 49).all()
    # over more than one period of 511 bits, ups and downs balance
    assert abs(common.mean()) < 0.1


def test_a_dry_run_prints_a_segments_own_keys() -> None:
    class Pulse(BaseSegment):
        common_V: float = 1.0
        band_Hz: tuple[float, float] = (0.1, 2.5)
        axis: str = "yaw"
        learn_s: float | None = None

    line = Pulse(kind="pulse", duration_s=10.0, roll_deg=8.0).summary()
    assert line == "pulse 10 s to roll 8°, common_V 1, band_Hz 0.1 to 2.5, axis yaw"
    assert kinds()["hold"](kind="hold", duration_s=3.0).summary() == "hold 3 s"
