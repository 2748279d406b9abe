"""`diagnose` end to end: an unmodified rig has no finding.

tests/cli/test_diagnose.py has a hidden effect, named with its size.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import pytest

from heli3dof.diagnosis import diagnose as module
from heli3dof.diagnosis.conclusion.adoption import AdoptionResult, adopted
from heli3dof.diagnosis.diagnose import diagnose
from heli3dof.diagnosis.result import Diagnosis, Dropped
from heli3dof.experiment.plan import Plan, step_plan
from heli3dof.recording.recording import Recording
from tests.flown import flown
from tests.hidden.cases import blind
from tests.hidden.rig_cases import draw_on_other_rig
from tests.profiles import profile


def flight(plan: Plan, hide: str, seed: int) -> Recording:
    device = f"mock:?speed=max&hide={hide}&seed={seed}&spread=0.07"
    return flown(plan, device=device, seed=seed, profile=profile(rate_hz=250.0))


def test_a_step_flight_of_the_unmodified_rig_has_no_finding() -> None:
    result = diagnose(flight(step_plan((10.0, None, None)), "", 1102), quick=True)
    assert result.verdict == "off_calibration"  # the rig is up to 7 % off its profile
    assert not result.findings
    assert "drag.quadratic.yaw" in result.not_identifiable


@pytest.mark.accuracy
@pytest.mark.parametrize("seed", [9000007, 9000009])
def test_of_a_step_with_an_implausible_inertia_nothing_is_asserted_without_the_controller(
    seed: int,
) -> None:
    """By likelihood alone, the first has a torque on pitch, the second a roll inertia off nominal.
    Nothing is hidden in them."""
    result = diagnose(blind(draw_on_other_rig("rigs-step-nothing", seed).fly()))
    assert result.findings == ()
    assert result.calibration_findings == ()
    assert result.residual_torques == ()


def test_a_search_whose_causes_are_dropped_restarts_without_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """If it then finds nothing, the result is the base fit. A fit with causes has a wider prior of
    implausible inertias, which must not outlive them."""
    device = "mock:?speed=max&hide=stiffness.cable.yaw:0.3"
    recording = flown("rich", 20.0, device=device, seed=2, profile=profile(rate_hz=250.0))
    searches = list[list[str]]()

    def drop_all(fit: Any, choices: Sequence[Any], held: Any, *, seed: int) -> Any:
        if not choices:
            return adopted(fit, choices, held, seed=seed)
        searches.append([c.term.name for c in choices])
        dropped = (Dropped(name, cast(Any, None)) for name in searches[-1])
        return AdoptionResult(fit, (), tuple(dropped), cast(Any, None))

    monkeypatch.setattr(module, "adopted", drop_all)
    result = diagnose(recording, quick=True)
    assert searches[0] == ["stiffness.cable.yaw"]
    names = [name for search in searches for name in search]
    assert len(names) == len(set(names)) > 1
    assert [d.name for d in result.dropped] == names
    assert json.loads(json.dumps(result.to_dict()))["verdict"] == result.verdict
    assert result.fitted is not None
    assert result.fitted.final is result.fitted.base


@pytest.mark.accuracy
def test_a_cause_dropped_without_the_controller_leaves_a_plausible_inertia() -> None:
    """The flight has sinusoidal torques. Its likelihood alone has an eighth of the inertia."""
    result = diagnose(blind(draw_on_other_rig("rigs-step-nothing", 2941).fly()))
    assert [d.name for d in result.dropped] == ["friction.coulomb.roll"]
    assert result.fitted is not None
    roll = result.fitted.final.values[1]  # type: ignore[union-attr]
    nominal = result.fitted.model.structure.free[1].start
    assert 0.8 < roll / nominal < 1.25


@pytest.mark.accuracy
def test_a_slow_torque_is_found_with_an_identified_controller() -> None:
    """A constant torque changes the steady voltages. The nulls must not repeat this change."""
    device = "mock:?speed=max&hide=bias.torque.pitch:0.03"
    recording = flown("steps", 45.0, device=device, seed=70)
    profile = recording.profile.model_copy(update={"controller": None})
    result = diagnose(replace(recording, profile=profile), quick=True)
    (cause,) = result.findings
    assert cause.term.name == "bias.torque.pitch"
    assert cause.values["torque_Nm"][0] == pytest.approx(0.03, rel=0.1)
    assert result.about["nulls"] == "simulated"


def test_the_document_names_the_rig_of_the_next_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the device, the printed command would fly another rig."""
    found = Diagnosis(("a",), (), "nothing_found", (), about={"seed": 3})
    monkeypatch.setattr(module, "_diagnosed", lambda *args, **options: found)
    r = replace(
        flown("steps", 3.0, device="mock:?speed=max"),
        meta={"device": "mock:?seed=3", "identity": {"serial": "ex-0123456789ab"}},
    )
    result = diagnose(r)
    assert result.to_dict()["about"] == {
        "seed": 3, "device": "mock:?seed=4", "exercises": ["0123456789ab"]
    }  # fmt: skip
    assert "heli3dof run large --device 'mock:?seed=4'" in result.summary()
