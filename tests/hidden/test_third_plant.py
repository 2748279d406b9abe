"""The third plant: its mechanics, its independence of the package, and its flights."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

from heli3dof.recording.recording import Recording
from tests.hidden.run import one
from tests.hidden.third_cases import NAMED, THIRD_CLASSES, draw_third
from tests.hidden.third_plant import body, draw, effects, loop
from tests.hidden.tools import Tool

ALLOWED = (
    "heli3dof.recording.recording.", "heli3dof.rig.profile.", "heli3dof.errors.",
    "tests.hidden.sizes.", "tests.hidden.third_plant.",
)  # fmt: skip
LOOP = loop.Loop(500, rounds=False, half_count=False, integrals_first=False)
NOTHING_ON_A_STEP = 17
"""Seed of ``third-nothing`` whose plan is the 20 s step"""


def mechanics(x: np.ndarray, rig) -> tuple[np.ndarray, float]:
    """Mass matrix and energy, with the potential energy written a second time."""
    M, h, G = np.empty((3, 3)), np.empty(3), np.empty(3)
    body.mass_terms(x, rig, 0.0, M, h, G)
    height = body.trim_torque(rig) * np.sin(x[0])
    height += 9.81 * (rig["m_f"] - rig["m_b"]) * rig["L_h"] * np.sin(x[1]) * np.cos(x[0])
    return M, 0.5 * x[3:6] @ M @ x[3:6] + height


def test_a_free_swing_keeps_energy_and_angular_momentum_about_the_vertical() -> None:
    rig = effects.nominal()
    rig["m_f"] *= 1.1
    x = np.array([0.3, -0.4, 0.2, 0.8, -2.5, 1.5, 0.0, 0.0])
    M, energy = mechanics(x, rig)
    momentum = M[2] @ x[3:6]
    for k in range(5000):
        loop.step(x, x[:3].copy(), k * 1e-3, 1e-3, np.zeros(2), np.zeros(3), rig)
    M, after = mechanics(x, rig)
    assert after == pytest.approx(energy, abs=1e-8)
    assert M[2] @ x[3:6] == pytest.approx(momentum, abs=1e-8)


def test_the_level_rig_has_the_profiles_inertias_and_trim_torque() -> None:
    p = draw.profile(LOOP, known=False)
    M, _ = mechanics(np.zeros(8), effects.nominal())
    assert np.diag(M) == pytest.approx(p.inertias)
    assert np.diag(np.diag(M)) == pytest.approx(M)
    assert -p.gravity_torque == pytest.approx(p.trim_torque)


def test_the_hover_voltage_and_a_cable_s_torque_are_those_computed_by_hand() -> None:
    """(0.6604 · 1.426 − 0.4699 · 1.87) · 9.81 = 0.6182 N·m, over 2 · 0.6604 · 0.1188 N·m/V; a
    cable of 0.12 N·m/rad at π/6."""
    rig = effects.nominal()
    assert rig["V_o"] == pytest.approx(0.6182 / 0.15691, abs=1e-3)
    Q = np.zeros(3)
    effects.EFFECTS["stiffness.cable.yaw"].hide(rig, 0.12)
    effects.add_torques(np.array([0, 0, np.pi / 6, 0, 0, 0, 0, 0]), 0.0, 0.0, 0.0, rig, Q)
    np.testing.assert_allclose(Q, [0, 0, -0.0628], atol=1e-4)


def test_dry_friction_stops_the_yaw_axis_within_the_time_computed_by_hand() -> None:
    """0.05 N·m slow a balanced rig of J_ψ down from 0.5 rad/s within 10 J_ψ s."""
    rig = effects.nominal()
    rig["L_w"] = rig["L_a"] * 1.426 / 1.87
    effects.EFFECTS["friction.coulomb.yaw"].hide(rig, 0.05)
    x = np.zeros(8)
    x[5] = 0.5
    k = 0
    while x[5] > 0.0:
        loop.step(x, x[:3].copy(), k * 1e-3, 1e-3, np.zeros(2), np.zeros(3), rig)
        k += 1
    assert k * 1e-3 == pytest.approx(10 * body.inertias(rig)[2], rel=2e-3)
    assert x[5] == 0.0


def test_equal_seeds_draw_equal_cases() -> None:
    for group in THIRD_CLASSES:
        assert draw_third(group, 1003) == draw_third(group, 1003)
        assert draw_third(group, 1003) != draw_third(group, 1004)
    rngs = [np.random.default_rng(5) for _ in range(2)]
    a, b = (loop.fly(LOOP, draw.draw_task("rich", 2.0, LOOP, 0, 0.1, r), draw.draw_rig(r))
            for r in rngs)  # fmt: skip
    assert a is not None
    assert b is not None
    assert np.array_equal(a.voltage, b.voltage)
    assert np.array_equal(a.state, b.state)


def test_a_class_of_single_effects_has_each_effect_equally_often() -> None:
    drawn = [draw_third("third-rich", seed).hidden[0].name for seed in range(2 * len(NAMED))]
    assert sorted(drawn) == sorted(2 * NAMED)


def test_a_tool_gets_log_and_holdout_with_angles_on_whole_counts() -> None:
    given: list[Recording] = []
    tool = Tool("a tool that finds nothing", lambda *r: given.extend(r) or {}, (), True)
    line = one("third-nothing", NOTHING_ON_A_STEP, tool)
    assert line["truth"]["names"] == []
    assert [r.meta["name"] for r in given] == ["flight", "holdout"]
    assert [round(r.t[-1]) for r in given] == [20, 40]
    for r in given:
        counts = r.angle / r.profile.encoder.rad_per_count
        assert counts == pytest.approx(np.round(counts), abs=1e-6)


def test_the_plant_imports_no_model_identification_or_diagnosis() -> None:
    for path in Path(body.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                names = [f"{node.module}.{a.name}" for a in node.names]
            elif isinstance(node, ast.Import):
                names = [f"{a.name}." for a in node.names]
            else:
                continue
            for name in names:
                ours = name.startswith(("heli3dof", "tests"))
                assert not ours or f"{name}.".startswith(ALLOWED), f"{path.name} imports {name}"
