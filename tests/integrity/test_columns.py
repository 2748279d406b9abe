"""Swapped columns are detected from the motion and reported by their names."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import heli3dof as h3
from heli3dof.integrity import Kind, integrity
from heli3dof.integrity.columns import agreement, inconsistent, is_consistent
from heli3dof.integrity.response import Response
from heli3dof.recording.recording import Recording
from tests.integrity.flights import flight, only
from tests.model.examples import with_motor
from tests.paths import REAL_DATA, needs_real_data

NAMES = (
    "roll_deg", "pitch_deg", "yaw_deg", "v_front_V", "v_back_V", "roll_ref_deg", "pitch_ref_deg",
    "yaw_ref_deg",
)  # fmt: skip


def swapped(r: Recording, a: int, b: int) -> Recording:
    """Return a log with columns a and b swapped, without the columns that only heli3dof writes."""
    T = np.column_stack([np.degrees(r.angle), r.voltage, np.degrees(r.reference)])
    T[:, [a, b]] = T[:, [b, a]]
    unknown = np.full_like(r.voltage, np.nan)
    return replace(
        r, angle=np.radians(T[:, :3]), voltage=T[:, 3:5], reference=np.radians(T[:, 5:]),
        voltage_cmd=unknown, voltage_extra=unknown, channels={},
    )  # fmt: skip


@pytest.mark.parametrize("plan", ["rich", "run-step"])
@pytest.mark.parametrize(
    ("a", "b"),
    [(0, 1), (0, 2), (1, 2), (0, 3), (1, 3), (1, 4), (2, 4), (0, 5), (0, 6), (3, 6), (5, 6)],
)
def test_two_swapped_columns_are_named(plan: str, a: int, b: int) -> None:
    fault = only(swapped(flight(plan), a, b))
    assert (fault.check, fault.kind) == ("columns.swapped", Kind.BAD_DATA)
    assert f"{NAMES[a]} and {NAMES[b]}" in fault.fix


def test_an_axis_at_rest_is_recognised_by_its_encoder_grid() -> None:
    fault = only(swapped(flight("run-step"), 2, 7))
    assert fault.fix.startswith("swap the names yaw_deg and yaw_ref_deg")
    assert "0.0439°" in fault.sentence  # 360°/8192


@needs_real_data
@pytest.mark.parametrize(("rig", "name"), [("rig-a", "closed-1b"), ("rig-b", "closed-08")])
def test_swapped_columns_are_named_in_real_logs(rig: str, name: str) -> None:
    profile = h3.load_profile(REAL_DATA / rig / "profile.toml")
    real = h3.load(REAL_DATA / rig / f"{name}.csv", profile)
    for a, b in ((0, 1), (0, 2), (1, 2), (1, 3), (2, 3)):
        stops = [f for f in integrity(swapped(real, a, b)) if f.kind == Kind.BAD_DATA]
        assert [f.check for f in stops] == ["columns.swapped"], (a, b)
        assert f"{NAMES[a]} and {NAMES[b]}" in stops[0].fix


def test_consistency_and_agreement_of_a_response() -> None:
    right, weak = Response(1.0, 0.01, 0.9, 0.2), Response(0.6, 0.1, 0.45, 0.1)
    wrong = Response(0.1, 0.01, 0.9, 0.2)
    assert is_consistent(right)
    assert not is_consistent(weak)
    responses = {"roll": right, "pitch": weak, "yaw": wrong}
    assert inconsistent(responses) == {"yaw"}
    # Half the gain is ln 2/0.5 = 1.386 widths `USUAL` off: exp(−½ 1.386²) = 0.3825.
    assert agreement({"roll": replace(right, gain=0.5)}) == pytest.approx(0.9 * 0.3825, rel=1e-3)
    assert inconsistent({"yaw": replace(wrong, drive=0.001)}) == set()


@pytest.mark.parametrize("factor", [0.25, 4.0])
def test_a_wrong_thrust_gain_is_no_swap(factor: float) -> None:
    """All responses have the wrong size, but explain the motion."""
    r = flight("rich")
    wrong = with_motor(r.profile, K_f=factor * r.profile.motor.K_f)
    faults = integrity(replace(swapped(r, 0, 0), profile=wrong))
    assert "columns.swapped" not in [f.check for f in faults]
