"""Plans are read, summarised, rendered reproducibly, and refused outside the profile's limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heli3dof.errors import PlanError, UsageError
from heli3dof.experiment.plan import (
    checked,
    load_plan,
    named_plans,
    plan_from_dict,
    step_plan,
)
from heli3dof.experiment.segments import kinds
from heli3dof.rig.profile import default_profile

DT = 0.002


def plan_of(*segments: dict) -> dict:
    return {"name": "test", "segment": list(segments)}


def test_a_step_holds_zero_then_the_target() -> None:
    signals = step_plan((10.0, None, None), settle_s=1.0, duration_s=2.0).render(DT, 0)
    assert signals.reference.shape == (1500, 3)
    np.testing.assert_allclose(signals.reference[:500], 0)
    np.testing.assert_allclose(np.degrees(signals.reference[500:]), [[10, 0, 0]] * 1000)
    assert not signals.extra.any()


def test_a_step_takes_angles_by_name_or_in_a_row() -> None:
    assert step_plan(roll=10, yaw=-5.0) == step_plan((10, None, -5))
    assert step_plan(pitch=2, settle_s=0).segments[0].pitch_deg == 2.0
    with pytest.raises(UsageError, match="two angles for roll"):
        step_plan((10, None, None), roll=5)


def test_references_that_are_not_given_keep_their_values() -> None:
    plan = plan_from_dict(
        plan_of(
            {"kind": "step", "roll_deg": 5, "yaw_deg": -20, "duration_s": 0.01},
            {"kind": "step", "yaw_deg": 20, "duration_s": 0.01},
            {"kind": "hold", "duration_s": 0.01},
        )
    )
    np.testing.assert_allclose(np.degrees(plan.render(DT, 0).reference[-1]), [5, 0, 20])


@pytest.mark.parametrize("name", sorted(named_plans()))
def test_every_plan_that_ships_is_inside_the_default_envelope(name: str) -> None:
    plan = load_plan(name)
    assert plan.name == name
    assert plan.description
    checked(plan, default_profile(), 1)
    assert len(plan.summary()) == len(plan.segments)


def test_a_plan_survives_a_round_trip_through_its_dict() -> None:
    plan = load_plan("multisine")
    assert plan_from_dict(plan.to_dict()) == plan


def multisine(**keys: object) -> np.ndarray:
    plan = plan_from_dict(plan_of({"kind": "multisine", "duration_s": 10.0, **keys}))
    return plan.render(DT, 3).extra


def test_a_multisine_has_its_rms_and_orthogonal_common_and_difference() -> None:
    extra = multisine(common_V=0.5, difference_V=0.2)
    common, difference = extra.sum(axis=1) / 2, (extra[:, 0] - extra[:, 1]) / 2
    assert np.sqrt(np.mean(common**2)) == pytest.approx(0.5)
    assert np.sqrt(np.mean(difference**2)) == pytest.approx(0.2)
    assert np.mean(common * difference) == pytest.approx(0, abs=1e-12)


def test_a_multisine_has_power_only_in_its_band() -> None:
    extra = multisine(band_Hz=[0.5, 2.0])
    power = np.abs(np.fft.rfft(extra[:, 0])) ** 2
    f = np.fft.rfftfreq(len(extra), DT)
    inside = (f >= 0.5) & (f <= 2.0 + 1e-9)
    assert power[~inside].sum() < 1e-12 * power.sum()


@given(seed=st.integers(0, 2**31))
def test_the_same_seed_renders_the_same_plan_and_starts_quietly(seed: int) -> None:
    plan = plan_from_dict(plan_of({"kind": "multisine", "duration_s": 2.0}))
    a, b = plan.render(0.01, seed), plan.render(0.01, seed)
    np.testing.assert_array_equal(a.extra, b.extra)
    assert np.abs(a.extra[0]).max() < 0.5


@pytest.mark.parametrize(
    ("data", "parts"),
    [
        ({"name": "x"}, ["'segment'", "missing"]),
        (plan_of({"duration_s": 1}), ["segment 1", "kind"]),
        (plan_of({"kind": "stp", "duration_s": 1}), ["'stp'", "step"]),
        (plan_of({"kind": "step", "duration": 1}), ["duration", "duration_s"]),
        (plan_of({"kind": "step", "duration_s": -1}), ["duration_s", "greater than 0"]),
        (plan_of({"kind": "step", "duration_s": 1, "roll_deg": "ten"}), ["roll_deg", "ten"]),
        (plan_of({"kind": "hold", "duration_s": 1, "band_Hz": 3}), ["band_Hz"]),
        (plan_of({"kind": "multisine", "duration_s": 1, "band_Hz": [2, 1]}), ["rising"]),
        (plan_of({"kind": "multisine", "duration_s": 5, "band_Hz": [1, 2, 3]}), ["have 2 values"]),
        (plan_of({"kind": "multisine", "duration_s": 5, "band_Hz": [1]}), ["= [1] has too few"]),
        (plan_of({"kind": "multisine", "duration_s": 5, "band_Hz": 3}), ["= 3 must be a list"]),
    ],
)
def test_the_error_names_a_wrong_key(data: dict, parts: list) -> None:
    with pytest.raises(PlanError) as caught:
        plan_from_dict(data, source="my.toml")
    for part in [*parts, "my.toml"]:
        assert part in str(caught.value)


def test_a_segment_in_single_brackets_is_explained() -> None:
    with pytest.raises(PlanError) as caught:
        plan_from_dict({"name": "x", "segment": {"kind": "hold", "duration_s": 1}})
    assert "segment is one table; it must be a list of tables" in caught.value.what
    assert caught.value.fix == "write [[segment]] in plan"


def test_the_error_for_a_misspelt_name_suggests_the_nearest_plan() -> None:
    with pytest.raises(PlanError, match="did you mean 'steps'"):
        load_plan("stepps")


def test_a_plan_file_that_does_not_exist_is_named(tmp_path: Path) -> None:
    with pytest.raises(PlanError, match="no plan"):
        load_plan(tmp_path / "mine.toml")


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ((400, None, None), "roll 400°"),
        ((None, -61, None), "pitch −61°"),
        ((None, None, 800), "yaw"),
    ],
)
def test_a_target_outside_the_envelope_is_refused(target: tuple, message: str) -> None:
    plan = step_plan(target)
    with pytest.raises(PlanError, match=message):
        checked(plan, default_profile(), 0)


def test_a_plan_longer_than_the_envelope_allows_is_refused() -> None:
    plan = step_plan((1, None, None), duration_s=700)
    with pytest.raises(PlanError, match=r"lasts 710 s; the profile allows 600 s"):
        checked(plan, default_profile(), 0)


def test_more_volts_than_the_amplifier_gives_are_refused() -> None:
    plan = plan_from_dict(plan_of({"kind": "multisine", "duration_s": 5, "common_V": 30}))
    with pytest.raises(PlanError, match="the amplifier gives 24 V"):
        checked(plan, default_profile(), 0)


@pytest.mark.parametrize(
    ("reference", "extra", "mistake"),
    [
        (np.zeros((499, 3)), np.zeros((500, 2)), "references are not 500 × 3"),
        (np.zeros((500, 3)), np.zeros(500), "voltages are not 500 × 2"),
        (np.zeros((500, 3)), np.full((500, 2), np.nan), "voltages are not 500 × 2 finite"),
    ],
)
def test_a_segment_with_a_wrong_signal_is_named(
    reference: np.ndarray, extra: np.ndarray, mistake: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = plan_from_dict(plan_of({"kind": "hold", "duration_s": 1}))
    monkeypatch.setattr(kinds()["hold"], "render", lambda *_: (reference, extra))
    with pytest.raises(PlanError, match=rf"Segment 1 .*\(hold\) has no signal: its {mistake}"):
        plan.render(DT, 0)


def test_every_kind_of_segment_has_the_name_of_its_file() -> None:
    for name, kind in kinds().items():
        assert kind.model_fields["kind"].default == name
