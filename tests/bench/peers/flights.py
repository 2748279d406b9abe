"""Flies the rig of the comparison, an emulated one with known parameters.

It differs from the default profile, which the tools know: masses, thrust gain and hover voltage are
off by 5 or 6 %, as on a real rig, so that no fit starts at the true values. It also has the effects
of `HIDE`; the rest is `heli3dof_drivers.emulator`.
"""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import TABLE_I, Profile, default_profile, profile_from_dict
from tests.bench.peers import rigid

HIDDEN = {
    "motor.lag": 0.1,
    "stiffness.pendulum.roll": 1.0,
    "stiffness.pendulum.pitch": 0.01,
    "friction.viscous.roll": 0.05,
    "friction.viscous.pitch": 0.01,
    "friction.viscous.yaw": 0.1,
}
HIDE = ",".join(f"{name}:{value:g}" for name, value in HIDDEN.items())
OFF_NOMINAL = {"m_w": 1.05, "m_f": 0.94, "m_b": 0.94, "K_f": 1.06, "V_o": 0.95}
GUESS = {"k_r": 0.5, "k_p": 0.02, "c_r": 0.1, "c_p": 0.005, "c_y": 0.05, "tau_m": 0.05}
"""Start values of physical fits for parameters that the profile lacks: off by a factor of two"""
NOISE_NM = (0.035, 0.0035, 0.015)
"""N·m, standard deviation of the random torques on roll, pitch, yaw (docs/reference/mock.md)"""
CORRELATION_S = 0.01
"""s, their correlation time"""


def rig_profile() -> dict[str, Any]:
    """Returns the profile of the true rig, as a nested dict."""
    data = copy.deepcopy({k: v for k, v in TABLE_I.items() if k != "controller"})
    for section in ("mass", "motor"):
        for key, value in data[section].items():
            data[section][key] = value * OFF_NOMINAL.get(key, 1.0)
    return data


def physics_of(profile: Profile) -> dict[str, float]:
    """Returns a profile's inertias (kg·m², of point masses) and gravity torque T_g (N·m)."""
    g, m = profile.geometry, profile.mass
    J_p = (m.m_f + m.m_b) * g.L_h**2
    J_r = m.m_w * g.L_w**2 + (m.m_f + m.m_b) * g.L_a**2
    T_g = 2 * g.L_a * profile.motor.K_f * profile.motor.V_o
    return {"J_r": J_r, "J_p": J_p, "J_y": J_r + J_p, "T_g": T_g}


def nominal() -> np.ndarray:
    """Returns the start values of a physical fit, in the order of `rigid.NAMES`."""
    start = {**physics_of(default_profile()), **GUESS}
    return np.array([start[name] for name in rigid.NAMES])


def known() -> np.ndarray:
    """Returns the known constants of the nominal profile, in the order of `rigid.KNOWN`."""
    p = default_profile()
    return np.array([p.geometry.L_a, p.geometry.L_h, p.motor.K_f])


def truth() -> np.ndarray:
    """Returns the true parameters in the order of `rigid.NAMES`, scaled so that K_f is nominal.

    Voltages and angles determine torques and inertias only relative to K_f.
    """
    rig = profile_from_dict(rig_profile(), source="the bench's rig")
    scale = default_profile().motor.K_f / rig.motor.K_f
    torques = {
        **physics_of(rig),
        "k_r": HIDDEN["stiffness.pendulum.roll"],
        "k_p": HIDDEN["stiffness.pendulum.pitch"],
        "c_r": HIDDEN["friction.viscous.roll"],
        "c_p": HIDDEN["friction.viscous.pitch"],
        "c_y": HIDDEN["friction.viscous.yaw"],
    }
    return np.array([*[scale * torques[n] for n in rigid.NAMES[:-1]], HIDDEN["motor.lag"]])


def acceleration_noise() -> np.ndarray:
    """Returns σ √(2 τ_c) / J of the true rig, (3,) rad/s² per √Hz, two-sided."""
    J = physics_of(profile_from_dict(rig_profile(), source="the bench's rig"))
    inertia = np.array([J["J_r"], J["J_p"], J["J_y"]])
    return np.asarray(np.array(NOISE_NM) * np.sqrt(2 * CORRELATION_S) / inertia)


def fly(plan: str, seed: int, folder: Path, *, noise: float = 1.0) -> Recording:
    """Fly a plan from level; returns the recording, an MCAP file in ``folder``."""
    rig = folder / "rig.toml"
    if not rig.exists():
        rig.write_text(_toml(rig_profile()), encoding="utf-8")
    device = f"mock:?speed=max&start=level&profile={rig}&hide={HIDE}&seed={seed}&noise={noise:g}"
    output = folder / f"{plan}-{seed}{'' if noise else '-quiet'}.mcap"
    flight = fly_plan(load_plan(plan), device=device, seed=seed, output=output)
    flight.raise_if_cut_short()
    return flight.recording


def _toml(data: dict[str, Any]) -> str:
    lines = [f'name = "{data["name"]}"']
    for section in ("geometry", "mass", "motor", "encoder", "loop"):
        lines += ["", f"[{section}]", *[f"{k} = {v!r}" for k, v in data[section].items()]]
    return "\n".join(lines) + "\n"
