"""Other rigs: drawn within their bounds, flown to their end, and described to the diagnosis."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from heli3dof.recording.recording import Recording
from tests.hidden.cases import Hidden, plan_named
from tests.hidden.other_rigs import CONTROLLERS, PAPER, draw_rig, fly_rig
from tests.hidden.rig_cases import RIG_CLASSES, draw_on_other_rig, scale, sized
from tests.hidden.sizes import EFFECTS


def test_equal_seeds_draw_equal_rigs_and_a_third_of_them_has_no_controller() -> None:
    rigs = [draw_rig(seed) for seed in range(150)]
    assert draw_rig(7) == rigs[7]
    assert 35 <= sum(not rig.known for rig in rigs) <= 65
    assert set(Counter(rig.controller for rig in rigs)) == set(CONTROLLERS)


def test_drawn_rigs_differ_from_the_papers_rig_within_the_stated_bounds() -> None:
    for seed in range(50):
        p = draw_rig(seed).profile
        assert 1.8 <= p.motor.V_o <= 7.5
        assert 2.4 <= p.motor.v_max / p.motor.V_o <= 3.5
        assert 0.3 <= p.inertias[1] / PAPER.inertias[1] <= 3.0
        assert 100 <= p.loop.rate_hz <= 1000


def test_a_known_controller_without_a_variant_reproduces_the_logged_voltages() -> None:
    from heli3dof.model.control.controller import Controller

    rig = next(r for r in map(draw_rig, range(100)) if r.known and r.controller == "exact")
    log = fly_rig(rig, plan_named("run-step"))
    assert isinstance(log, Recording)
    controller = Controller.of(rig.profile)
    controller.reset((0.0, 0.0, 0.0))
    volts = [
        controller.step(tuple(log.angle[k]), tuple(log.reference[k]))[0] for k in range(len(log))
    ]
    np.testing.assert_allclose(volts, log.voltage_cmd, atol=1e-6)


def test_an_effect_accelerates_another_rig_as_it_does_the_papers() -> None:
    rig = draw_rig(3).profile
    effect = EFFECTS["friction.viscous.yaw"]
    hidden = sized(Hidden(effect.name, "medium", (0.08,)), effect, rig)
    assert hidden.values[0] / rig.inertias[2] == pytest.approx(0.08 / PAPER.inertias[2])
    assert all(scale(e, PAPER) == pytest.approx(1.0) for e in EFFECTS.values())


def test_at_least_three_hundred_cases_a_third_of_them_without_an_effect() -> None:
    total = sum(c.count for c in RIG_CLASSES.values())
    assert total >= 300
    assert 3 * sum(c.count for c in RIG_CLASSES.values() if not c.effects) >= total


def test_the_log_does_not_reveal_the_hidden_effect() -> None:
    case = draw_on_other_rig("rigs-single", 1000)
    log = case.fly()
    assert isinstance(log, Recording)
    assert set(log.meta) == {"name", "source"}
    assert not log.channels
