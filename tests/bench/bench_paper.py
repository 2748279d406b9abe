"""Recomputes the paper's numbers and compares them."""

from __future__ import annotations

import numpy as np

import heli3dof as h3
from heli3dof.model.linear.hover import hover, quiescent_voltage
from heli3dof.rig.profile import K_G, default_profile
from tests.bench import Figure
from tests.model.control.ideal_loop import loop_poles, paper_gain, step_response
from tests.pages.paper_page import with_V_o_by_eq_6

TITLE = "The paper's numbers"
INTRO = (
    "A row is met if the number agrees in every printed digit (for the sampled loop: within 0.03°, "
    "as the reference states). The tests under `tests/model` check all of them and the errata; "
    "[paper.md](paper.md) has the whole list."
)


def golden(what: str, value: float, expected: str, unit: str, how: str = "") -> Figure:
    """Returns the figure of a number that must agree to every digit of ``expected``."""
    digits = len(expected.partition(".")[2])
    text = f"{value:.{digits}f}"
    return Figure(what, f"{text} {unit}", f"{expected} {unit}", text == expected, how)


def near(what: str, value: float, expected: float, how: str = "") -> Figure:
    """Returns the figure of a number that must be within 0.03° of ``expected``."""
    met = abs(value - expected) <= 0.03
    return Figure(what, f"{value:.2f} °", f"{expected:g} ± 0.03 °", met, how)


def sampled(target: tuple[float | None, float | None, float | None]) -> np.ndarray:
    """Returns the angles (N, 3) in ° of a step from level with the sampled controller.

    ``target``: roll, pitch, yaw in °; None: no step.
    """
    plan = h3.step_plan(target, settle_s=0.0, duration_s=12.0)
    profile = default_profile()
    flown = h3.simulate(plan, h3.hover_model(profile), start="level", quantised=False)
    return np.asarray(np.degrees(flown.angle))


def measure() -> list[Figure]:
    profile = default_profile()
    model, K = hover(profile), np.array(K_G)
    gain = paper_gain(hover(with_V_o_by_eq_6(profile)))[0]
    step = step_response(model, K, np.radians([10.0, 0.0, 0.0]))
    roll = np.degrees(step.angle[:, 0])
    yaw = np.degrees(step_response(model, K, np.radians([0.0, 0.0, 10.0])).angle[:, 2])
    ours_roll, ours_yaw = sampled((10.0, None, None)), sampled((None, None, 20.0))
    unstable = loop_poles(hover(profile, printed=True), K)[0].real
    how = "continuous time, ideal rates"
    flown = "`simulate` on the hover model with the controller that flies"
    return [
        golden("V_o by eq (6)", quiescent_voltage(profile), "7.456", "V"),
        golden("first gain of K_g by its LQR", gain[0], "37.6707", "V/rad"),
        golden("unstable pole of the model as printed", unstable, "1.469", "1/s"),
        golden("10° roll step, peak", float(roll.max()), "11.85", "°", how),
        golden("10° roll step, time of the peak", float(step.t[roll.argmax()]), "1.77", "s", how),
        golden("10° roll step, after 10 s", float(roll[10_000]), "10.10", "°", how),
        golden("10° yaw step, peak", float(yaw.max()), "11.61", "°", how),
        near("10° roll step, peak", float(ours_roll[:, 0].max()), 11.75, flown),
        near("10° roll step, after 10 s", float(ours_roll[5000, 0]), 10.10, flown),
        near("20° yaw step, yaw peak", float(ours_yaw[:, 2].max()), 23.18, flown),
        near("20° yaw step, pitch peak", float(ours_yaw[:, 1].min()), -13.55, flown),
    ]
