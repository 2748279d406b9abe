"""The tables of docs/explanation/paper.md: every number there that the code computes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from heli3dof.model.base import LoopTask
from heli3dof.model.control.closed_loop_poles import rightmost_first
from heli3dof.model.linear.hover import (
    Hover,
    hover,
    hover_model,
    quiescent_voltage,
)
from heli3dof.rig.profile import K_G, Profile, default_profile
from tests.model.control.ideal_loop import (
    Response,
    loop_poles,
    paper_gain,
    step_response,
    with_rotor_lag,
)
from tests.pages.page import Page, table

REST_DEG = -27.5
"""Roll of the rig on its table (E2)."""
LITERAL = {"L_w": 0.6604, "L_a": 0.4699}
"""Table I's rows 14 and 15 by their descriptions: the symbols change places (E1)."""


def taken_literally(profile: Profile) -> Profile:
    """The profile with the arm lengths as Table I describes them (E1)."""
    geometry = profile.geometry.model_copy(update=LITERAL)
    return profile.model_copy(update={"geometry": geometry})


def with_V_o_by_eq_6(profile: Profile) -> Profile:
    """The profile with V_o to every digit of (6), where Table I's rig has 7.456 V."""
    motor = profile.motor.model_copy(update={"V_o": quiescent_voltage(profile)})
    return profile.model_copy(update={"motor": motor})


def _minus(text: str) -> str:
    return text.replace("-", "−")


def _poles(s: np.ndarray, digits: int) -> str:
    words = []
    for p in rightmost_first(s):
        if abs(p.imag) < 1e-9:
            words.append(f"{p.real:.{digits}f}")
        elif p.imag > 0:
            words.append(f"{p.real:.{digits}f} ± {p.imag:.{digits}f}j")
    return _minus(", ".join(words))


def _matrices() -> str:
    """The numbers of (5), (6), (10), (11): as printed and corrected."""
    p = default_profile()
    printed, right = hover(p, printed=True), hover(with_V_o_by_eq_6(p))
    J_roll, J_pitch, J_yaw = p.inertias
    rows = [
        ("gravity torque, right side of (5)", f"{p.gravity_torque:.3f} N·m", "the same"),
        ("V_o, (6)", f"{printed.V_o:.3f} V", "the same number, to be calibrated (E2)"),
        (
            "J_roll, J_pitch, J_yaw",
            f"{J_roll:.4f}, {J_pitch:.5f}, {J_yaw:.4f} kg·m²",
            "the same",
        ),
        (
            "A[6,2], (10), 1/s²",
            f"{printed.A[5, 1]:+.4f}",
            _minus(f"{right.A[5, 1]:+.4f}") + " (E3)",
        ),
        ("B[4,·], (11), rad/s² per V", f"{printed.B[3, 0]:.5f}", f"{right.B[3, 0]:.5f}"),
        ("B[5,1], (11), rad/s² per V", f"{printed.B[4, 0]:.3f}", f"{right.B[4, 0]:.4f} (E4)"),
    ]
    return table(("quantity", "as printed", "corrected"), rows)


def _gain() -> str:
    """K_g as printed and as the LQR design gives it, with the corrected and the printed model."""
    p = with_V_o_by_eq_6(default_profile())
    names = ("r", "p", "ψ", "ṙ", "ṗ", "ψ̇", "∫r", "∫ψ")
    design, printed = paper_gain(hover(p))[0], paper_gain(hover(p, printed=True))[0]
    rows = [
        ("(14), front motor", *(_minus(f"{k:.1f}") for k in K_G[0])),
        ("LQR, corrected model", *(_minus(f"{k:.4f}") for k in design)),
        ("LQR, printed model", *(_minus(f"{k:.4f}") for k in printed)),
    ]
    return table(("gain on", *names), rows)


def _loop() -> str:
    """The corrected model in the loop with K_g, and what goes wrong otherwise."""
    p = default_profile()
    K = np.array(K_G)
    right, printed = hover(p), hover(p, printed=True)
    worst = loop_poles(printed, K)[0].real
    rows = [
        ("poles, corrected model", _poles(loop_poles(right, K), 3) + " rad/s"),
        ("rightmost pole, printed model", f"{worst:+.3f} rad/s"),
        *_steps(right, K),
        *_sampled(p),
    ]
    return table(("quantity", "computed"), rows)


def _steps(h: Hover, K: np.ndarray) -> Iterator[tuple[str, str]]:
    def step(roll: float = 0.0, yaw: float = 0.0, **options: object) -> Response:
        return step_response(h, K, np.radians([roll, 0.0, yaw]), **options)  # type: ignore[arg-type]

    limit = np.radians(45)
    r = step(roll=10)
    y20 = step(yaw=20, rate_limit=limit)
    rest = step(roll=10, angle0=np.radians([REST_DEG, 0, 0]), v_max=24.0, duration_s=5.0, dt=2e-3)
    roll = np.degrees(r.angle[:, 0])
    outside = r.t[abs(roll - 10) > 0.2][-1]
    yield "10° roll step: roll peak", f"{roll.max():.2f}° at {r.t[roll.argmax()]:.2f} s"
    yield "10° roll step: roll after 10 s", f"{roll[10_000]:.2f}°"
    yield "10° roll step: settling time to ±2 %", f"{outside:.1f} s"
    yaw = np.degrees(y20.angle)
    yield (
        "20° yaw step behind the 45°/s limiter: yaw peak, pitch range",
        _minus(f"{yaw[:, 2].max():.2f}°, {yaw[:, 1].min():.2f}° … {yaw[:, 1].max():.2f}°"),
    )
    yield (
        "10° roll step from rest on the table, ±24 V: roll peak",
        f"{np.degrees(rest.angle[:, 0].max()):.1f}°",
    )
    slow = step_response(
        with_rotor_lag(h, 0.2),
        K,
        np.radians([10.0, 0, 0]),
        x0=np.array([np.radians(REST_DEG), 0, 0, 0, 0, 0, -h.V_o, -h.V_o]),
        v_max=24.0,
        duration_s=5.0,
        dt=2e-3,
    )
    yield (
        "the same, with a rotor lag of 0.2 s and rotors at standstill: roll peak",
        f"{np.degrees(slow.angle[:, 0].max()):.1f}°",
    )


def _sampled(profile: Profile) -> Iterator[tuple[str, str]]:
    model = hover_model(profile)
    spec = profile.controller
    assert spec is not None

    def fly(roll: float = 0.0, start: float = 0.0) -> np.ndarray:
        N = 6000
        task = LoopTask(
            reference=np.tile(np.radians([roll, 0.0, 0.0]), (N, 1)),
            extra=np.zeros((N, 2)),
            angle0=np.radians([start, 0.0, 0.0]),
            controller=spec,
            V_o=profile.motor.V_o,
            v_max=profile.motor.v_max,
            dt=profile.dt,
        )
        return np.asarray(np.degrees(model.fly(task).angle))

    roll, rest = fly(roll=10), fly(roll=10, start=REST_DEG)
    yield (
        "sampled controller, 10° roll step: roll peak, roll after 10 s",
        f"{roll[:, 0].max():.2f}°, {roll[5000, 0]:.2f}°",
    )
    yield (
        "sampled controller, 10° roll step from rest on the table: roll peak",
        f"{rest[:, 0].max():.1f}°",
    )


PAGE = Page(
    "docs/explanation/paper.md",
    {"matrices": _matrices, "gain": _gain, "loop": _loop},
)
